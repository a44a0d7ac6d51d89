"""Shipped mechanisms. To add one, write a file with a function that gives a ``Mechanism``."""

from __future__ import annotations

from fastmech.mechanisms.cart_pendulum import cart_pendulum
from fastmech.mechanisms.double_pendulum import double_pendulum
from fastmech.mechanisms.pendulum_chain import pendulum_chain
from fastmech.mechanisms.slider_pendulum import slider_pendulum
from fastmech.mechanisms.von_mises_truss import von_mises_truss
from fastmech.mechanisms.ziegler_column import ziegler_column

__all__ = [
    "cart_pendulum",
    "double_pendulum",
    "pendulum_chain",
    "slider_pendulum",
    "von_mises_truss",
    "ziegler_column",
]
