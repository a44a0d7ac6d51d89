"""What fastmech runs on: processor, width of its vectors, threads, kernel cache, libraries."""

from __future__ import annotations

import re
from importlib import metadata

import numba
from rich.table import Table

from fastmech.cli.vectors import reason
from fastmech.ensembles.threads import thread_count
from fastmech.jit import FLAGS
from fastmech.kernel_cache import cache_directory
from fastmech.kernels.select import with_terms
from fastmech.store.provenance import processor_name

LIBRARIES = ("numba", "llvmlite", "numpy", "scipy", "h5py")


def vector_bits() -> int:
    """Widest registers in the machine code of a shipped right-hand side, compiled here."""
    shipped = with_terms("lagrange", "damped_constant")
    (signature,) = shipped.signatures
    fresh = numba.njit(signature, nogil=True, **FLAGS)(shipped.py_func)
    code = "".join(fresh.inspect_asm().values())
    widths = {"zmm": 512, "ymm": 256, "xmm": 128}
    return next((bits for name, bits in widths.items() if re.search(rf"pd\s.*%{name}", code)), 64)


def describe_system() -> Table:
    """A table of what results and speed depend on."""
    from llvmlite import binding
    from numba.core import config

    target = getattr(config, "CPU_NAME", None) or binding.get_host_cpu_name()
    table = Table(show_header=False, box=None)
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    bits = vector_bits()
    for name, value in (
        ("fastmech", metadata.version("fastmech")),
        ("processor", processor_name()),
        ("threads", str(thread_count(None))),
        ("vectors", f"{bits} bit, {bits // 64} float64 or {bits // 32} float32 lanes ({reason(bits)})"),
        ("compiled for", target),
        ("kernel cache", str(cache_directory())),
        *((library, metadata.version(library)) for library in LIBRARIES),
    ):
        table.add_row(name, value)
    return table
