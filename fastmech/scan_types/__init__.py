"""Kinds of scan, one file each; a new file in this folder is a new kind."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from inspect import isabstract

from fastmech.scan_types.request import Scan


@cache
def scan_kinds() -> dict[str, type[Scan]]:
    """Every kind of scan by its name in request files; with them their kernels are loaded or compiled."""
    modules = [import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    classes = [
        value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Scan) and value.__module__ == module.__name__
    ]
    return {scan.kind: scan for scan in classes if not isabstract(scan)}
