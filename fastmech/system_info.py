"""What fastmech runs on: processor, width of its vectors, threads, kernel cache, libraries."""

from __future__ import annotations

import re
from importlib import metadata

from llvmlite import binding
from numba.core import config

from fastmech.ensembles.threads import thread_count
from fastmech.jit import compiled_anew
from fastmech.kernel_cache import cache_directory
from fastmech.slider.kernels.select import with_terms
from fastmech.store.provenance import processor_name

LIBRARIES = ("numba", "llvmlite", "numpy", "scipy", "h5py")


def vector_bits() -> int:
    """Widest registers in the machine code of a shipped right-hand side, compiled here."""
    (code,) = compiled_anew(with_terms("lagrange", "damped_constant")).inspect_asm().values()
    widths = {"zmm": 512, "ymm": 256, "xmm": 128}
    return next((bits for name, bits in widths.items() if re.search(rf"pd\s.*%{name}", code)), 64)


class SystemInfo(dict[str, str]):
    """Facts by name; printed, one a line."""

    def __repr__(self) -> str:
        return "\n".join(f"{name:<14}{fact}" for name, fact in self.items())


def system_info() -> dict[str, str]:
    """What results and speed depend on: versions, processor, threads, vectors, kernel cache."""
    bits = vector_bits()
    facts = {
        "fastmech": metadata.version("fastmech"),
        "processor": processor_name(),
        "threads": str(thread_count(None)),
        "vectors": f"{bits} bit, {bits // 64} float64 or {bits // 32} float32 lanes",
        "compiled for": getattr(config, "CPU_NAME", None) or binding.get_host_cpu_name(),
        "kernel cache": str(cache_directory()),
        **{library: metadata.version(library) for library in LIBRARIES},
    }
    return SystemInfo(facts)
