from __future__ import annotations

import platform
from datetime import UTC, datetime, timedelta
from pathlib import Path

import h5py
import pytest

from fastmech.store.provenance import processor_name, provenance

LIBRARIES = ("fastmech", "python", "numba", "numpy", "scipy", "h5py", "hdf5")


def test_names() -> None:
    versions = [f"{name}_version" for name in LIBRARIES]
    told = ["created", "history", *versions, "platform", "processor", "threads"]
    assert list(provenance(threads=1)) == told


def test_values() -> None:
    attrs = provenance(threads=3)
    assert attrs["threads"] == 3
    assert attrs["h5py_version"] == h5py.__version__
    assert attrs["python_version"] == platform.python_version()
    created = datetime.fromisoformat(str(attrs["created"]))
    assert created.utcoffset() == timedelta(0)
    assert abs(datetime.now(UTC) - created) < timedelta(hours=1)


def test_processor_without_cpuinfo(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **options: object) -> str:
        raise FileNotFoundError

    monkeypatch.setattr(Path, "read_text", refuse)
    monkeypatch.setattr(platform, "processor", lambda: "")
    monkeypatch.setattr(platform, "machine", lambda: "arm64")
    assert processor_name() == "arm64"
