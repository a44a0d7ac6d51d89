from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("fastmech", derandomize=True, deadline=None)
settings.load_profile("fastmech")


@pytest.fixture(autouse=True)
def _no_figure_stays() -> Iterator[None]:
    """Close what ``plot()`` without axes has opened."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
