"""Shipped mechanisms; ``.replace`` gives their parameters other values.

To add one, write a file with a function that gives a ``Mechanism``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from fastmech.mechanisms.cart_pendulum import cart_pendulum
from fastmech.mechanisms.double_pendulum import double_pendulum
from fastmech.mechanisms.pendulum_chain import pendulum_chain
from fastmech.mechanisms.slider_pendulum import slider_pendulum
from fastmech.mechanisms.von_mises_truss import von_mises_truss
from fastmech.mechanisms.ziegler_column import ziegler_column
from fastmech.models.mechanism import MOST_COORDINATES, Mechanism

__all__ = [
    "cart_pendulum",
    "double_pendulum",
    "pendulum_chain",
    "slider_pendulum",
    "von_mises_truss",
    "ziegler_column",
]


def __dir__() -> list[str]:
    return __all__


def shipped() -> dict[str, Callable[[], Mechanism]]:
    """What makes each of them, by the names that requests and files have for them."""
    chains = {f"pendulum_chain_{n}": partial(pendulum_chain, n) for n in range(1, MOST_COORDINATES + 1)}
    return {name: globals()[name] for name in __all__ if name != "pendulum_chain"} | chains
