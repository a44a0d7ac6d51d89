"""Machine code of some kernels for a processor that this machine may not be, told by a process of its own.

Numba compiles for one processor in a process: ``NUMBA_CPU_NAME`` and ``NUMBA_CPU_FEATURES`` say for which.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import cache

#: The processor, features beside those that LLVM knows it has, and the width [bit] of its loops.
PROCESSORS = {
    "haswell": ("haswell", "", 256),
    "skylake-avx512 with 512 bit": ("skylake-avx512", "-prefer-256-bit", 512),
    "skylake-avx512 with 256 bit": ("skylake-avx512", "+prefer-256-bit", 512),
    "znver4": ("znver4", "", 512),
}

#: Kernels by name and precision, and how many packed products and sums their loop has at least.
KERNELS = {
    "own float64": 20,
    "lagrange rk4 float64": 240,
    "hamilton abm8 float64": 160,
    "own ab6 float64": 30,
    "own float32": 20,
    "lagrange rk4 float32": 160,
    "hamilton abm8 float32": 120,
    "own ab6 float32": 30,
}

SCRIPT = """
import json
import fastmech as fm
from fastmech.integrators.methods import METHODS
from fastmech.jit import compiled_anew
from fastmech.kernels.blocks import in_single
from fastmech.slider.kernels.select import with_terms
from fastmech.kernels.steps import whole_steps

def pendulum(t, x, v, damping):
    return v, -damping * v - fm.sin(x)

own = fm.System(pendulum, ["x", "v"], {"damping": 0.1}).kernel
lagrange, hamilton = with_terms("lagrange", "damped_constant"), with_terms("hamilton", "damped_decaying")

def steps(rhs, method, precision):
    return whole_steps(rhs.rates, METHODS[method].formulas[1], precision)

kernels = {}
for precision, chosen in (("float64", lambda rhs: rhs), ("float32", in_single)):
    kernels |= {
        "own " + precision: chosen(own),
        "lagrange rk4 " + precision: steps(lagrange, "rk4", precision),
        "hamilton abm8 " + precision: steps(hamilton, "abm8", precision),
        "own ab6 " + precision: steps(own, "ab6", precision),
    }
told = {}
for name, kernel in kernels.items():
    told[name] = "".join(compiled_anew(kernel).inspect_asm().values())
print(json.dumps(told))
"""


#: Motions of a scene and of an own system, some lanes beyond whole vectors.
MOTIONS = """
import hashlib
import json
import numpy as np
import fastmech as fm

def pendulum(t, x, v, damping):
    return v, -damping * v - fm.sin(x)

starts = np.random.default_rng(3).uniform(-2.0, 2.0, (37, 4))
own = fm.System(pendulum, ["x", "v"], {"damping": 0.1})
told = {}
for method, problem, begun in (("rk4", fm.Scene(), starts), ("abm8", own, starts[:, :2])):
    y = fm.integrate(problem, begun, 2.0, dt=0.01, method=method).y
    told[method] = hashlib.sha256(y.tobytes()).hexdigest()
print(json.dumps(told))
"""


def told_for(processor: str, script: str) -> dict[str, str]:
    """What a script says in JSON where everything is compiled for one of ``PROCESSORS``."""
    name, features, _ = PROCESSORS[processor]
    environment = os.environ | {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": features}
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )
    told: dict[str, str] = json.loads(done.stdout)
    return told


@cache
def machine_code(processor: str) -> dict[str, str]:
    """Assembler text of every kernel of ``KERNELS`` for one of ``PROCESSORS``."""
    return told_for(processor, SCRIPT)
