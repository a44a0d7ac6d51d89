"""What made a result: versions, machine and time."""

from __future__ import annotations

import platform
import shlex
import sys
from contextlib import suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

import h5py

#: Characters of a command line that are kept.
MOST_COMMAND = 2000


def provenance(threads: int) -> dict[str, str | int]:
    """The root attributes of a result made now, on this machine, by so many threads."""
    return {
        "created": _now(),
        "history": history_line(),
        "fastmech_version": _version("fastmech"),
        "python_version": platform.python_version(),
        **{f"{name}_version": _version(name) for name in ("numba", "numpy", "scipy", "h5py")},
        "hdf5_version": h5py.version.hdf5_version,
        "platform": platform.platform(),
        "processor": processor_name(),
        "threads": threads,
    }


def history_line() -> str:
    """Time and command line of this process, as CF's attribute ``history`` has them."""
    program, *arguments = sys.argv or [""]
    name = Path(program).name
    line = shlex.join(["fastmech" if name == "__main__.py" else name, *arguments])
    shown = "".join(c if c.isprintable() else "?" for c in line)[:MOST_COMMAND]
    return f"{_now()}: {shown} (fastmech {_version('fastmech')})"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def processor_name() -> str:
    """The processor's model name where the system tells it, else its architecture."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name" and value.strip():
                return value.strip()
    return platform.processor() or platform.machine() or "unknown"


def _version(distribution: str) -> str:
    # asks the installed metadata: importing numba or scipy for their version takes a second
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "not installed"
