"""512-bit vectors: asked for by the command line, where LLVM would leave them unused.

LLVM tunes for some processors with AVX-512 as if their wide registers slowed the clock (its tuning flag
``prefer-256-bit``). Loops over lanes are arithmetic from end to end, for which the wide ones are faster all
the same. The choice holds for a whole process and must be made before Numba is imported, so it is the
command's to make, never the library's. Numba keeps builds for different features side by side in its cache.
"""

from __future__ import annotations

import os
import platform
import sys

#: Processors that LLVM tunes so (X86.td, ``TuningPrefer256Bit``).
NARROWED = (
    "skylake-avx512",
    "cascadelake",
    "cooperlake",
    "cannonlake",
    "icelake-client",
    "icelake-server",
    "rocketlake",
    "tigerlake",
    "sapphirerapids",
    "emeraldrapids",
    "graniterapids",
    "graniterapids-d",
)

#: Where a user sets Numba's processor and features.
NAME, FEATURES = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"

WIDE = "-prefer-256-bit"


def ask_for_wide_vectors() -> None:
    """Ask for 512-bit vectors in this process where LLVM would not use them.

    Nothing is changed where the user has said what to compile for, or Numba is there already.
    """
    if "numba" in sys.modules or NAME in os.environ or FEATURES in os.environ:
        return
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    if binding.get_host_cpu_name() in NARROWED and features.get("avx512f", False):
        os.environ[FEATURES] = f"{features.flatten()},{WIDE}"


def reason(bits: int) -> str:
    """Why vectors have this width."""
    if NAME in os.environ or not os.environ.get(FEATURES, WIDE).endswith(WIDE):
        return f"as {NAME} and {FEATURES} say"
    if FEATURES in os.environ:
        return "asked for by this command: LLVM prefers 256 bit on this processor"
    return "LLVM's choice for this processor" if bits >= 512 else "the widest that this processor has"
