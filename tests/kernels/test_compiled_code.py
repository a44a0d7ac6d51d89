"""What the compiler made of the kernels: packed instructions, no library calls, no terms that a scene lacks.

Read from LLVM's optimized code and from the machine code, not from timings.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest
from kernels.blocks_of_lanes import COMBINATIONS, kernel, lanes
from numba import int64

from fastmech import jit
from fastmech.integrators.explicit import WEIGHTS, add_rows
from fastmech.integrators.methods import METHODS as REGISTRY
from fastmech.integrators.methods import Adams, RungeKutta
from fastmech.jit import MATRIX, VECTOR
from fastmech.kernels.steps import whole_steps
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.kernels.select import DAMPING, DECAY, FORCE, FORMULATIONS
from fastmech.slider.kernels.work import lagrange_work
from fastmech.slider.motion import tell_energies

pytestmark = pytest.mark.skipif(
    not llvm.get_host_cpu_features().get("fma", False),
    reason="no packed fused instructions on this processor",
)

KERNELS = {f"{formulation}-{terms}": kernel(formulation, terms) for formulation, terms in COMBINATIONS}
EXPLICIT = [method for method in REGISTRY.values() if isinstance(method, Adams | RungeKutta)]
STEPS = {
    f"{method.name}-{formulation}-{terms}": whole_steps(
        kernel(formulation, terms).rates, method.formulas[1], "float64"
    )
    for method, formulation, terms in [(method, "lagrange", "damped_constant") for method in EXPLICIT]
    + [
        (REGISTRY[name], formulation, terms)
        for name in ("rk4", "ab6", "abm8")
        for formulation in FORMULATIONS
        for terms in ("free", "damped_decaying")
    ]
}
SHIPPED = {**KERNELS, "work": lagrange_work, **STEPS}

PACKED = re.compile(r"\bv(?:f?n?m(?:add|sub)\d*|mul)\w*pd\s.*%[yz]mm")
VECTOR_ARITHMETIC = re.compile(r"= f(?:add|sub|mul|div) .*<[48] x double>")
PACKED_QUADRANT = re.compile(r"= shl .*<[48] x i64>")
PACKED_ROOT = re.compile(r"= .*call .*@llvm\.sqrt\.v[48]f64")
LIBRARY = re.compile(r"@(?:llvm\.)?(?:sin|cos|sincos|tan|exp|pow)\b")


@cache
def compiled_anew(shipped: Any) -> Any:
    """The kernel compiled in this process: numba shows no code of what it loaded from the disk cache."""
    return jit.compiled_anew(shipped)


def intermediate(shipped: Any) -> str:
    return "".join(compiled_anew(shipped).inspect_llvm().values())


def machine_code(shipped: Any) -> str:
    return "".join(compiled_anew(shipped).inspect_asm().values())


def basic_blocks(code: str) -> list[str]:
    """Pieces of LLVM's or the assembler's text between labels and between functions."""
    return re.split(r"^(?:[\w.$\"<>-]+:.*|})$", code, flags=re.MULTILINE)


def main_loop(shipped: Any) -> str:
    """The vector loop over lanes: the blocks of LLVM's code with packed square roots and quadrants."""
    blocks = basic_blocks(intermediate(shipped))
    return "\n".join(b for b in blocks if all(re.search(c, b) for c in (PACKED_QUADRANT, PACKED_ROOT)))


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.slow
def test_lanes_are_packed_without_library_calls(name: str) -> None:
    loop = main_loop(SHIPPED[name])
    assert len(VECTOR_ARITHMETIC.findall(loop)) >= 40
    assert not LIBRARY.search(loop)


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.slow
def test_machine_code_of_the_loop(name: str) -> None:
    """The same in machine code: one stretch between labels with packed quadrants and square roots."""
    blocks = basic_blocks(machine_code(SHIPPED[name]))
    loops = [b for b in blocks if re.search(r"\bvpsllq\s.*%[yz]mm", b)]
    loops = [b for b in loops if re.search(r"\bvsqrtpd\s.*%[yz]mm", b)]
    assert loops
    for loop in loops:
        assert len(PACKED.findall(loop)) >= 40
        assert not re.search(r"\bcall", loop)


def test_passes_over_trajectories_are_packed() -> None:
    """Their trigonometry is a loop of its own."""
    code = intermediate(tell_energies)
    assert PACKED_QUADRANT.search(code)
    assert PACKED_ROOT.search(code)
    assert len(VECTOR_ARITHMETIC.findall(code)) >= 80


def test_sums_of_rows_are_packed() -> None:
    arguments = (VECTOR, MATRIX, int64, WEIGHTS, int64)
    compiled = jit.compiled_anew(add_rows, arguments)
    assert len(PACKED.findall("".join(compiled.inspect_asm().values()))) >= 4


@pytest.mark.parametrize(("formulation", "terms"), COMBINATIONS)
def test_kernel_reads_the_coefficients_of_its_terms_only(formulation: str, terms: str) -> None:
    """A coefficient that is NaN poisons the kernel that reads it, and no other."""
    Y = lanes(9)
    forced = "constant" in terms or "decaying" in terms
    reads = {FORCE: forced, DAMPING: "damped" in terms, DECAY: "decaying" in terms}
    for row, expected in reads.items():
        params = np.repeat(np.array(reduce(Scene()))[:, None], Y.shape[1], axis=1)
        params[row] = np.nan
        dY = np.empty_like(Y)
        kernel(formulation, terms)(0.0, Y, dY, params)
        assert np.isnan(dY).any() == expected


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_every_term_costs_arithmetic_and_its_absence_none(formulation: str) -> None:
    """Packed operations for each vector of lanes; kernels may be unrolled differently, hence the quotient."""
    cost = {}
    for terms in ("free", "damped", "constant", "damped_constant", "decaying", "damped_decaying"):
        loop = main_loop(kernel(formulation, terms))
        cost[terms] = len(VECTOR_ARITHMETIC.findall(loop)) / len(PACKED_ROOT.findall(loop))
    assert cost["free"] < cost["damped"] < cost["damped_constant"]
    assert cost["free"] < cost["constant"] < cost["damped_constant"]
    # The exponential: 13 products and sums of a polynomial, 7 operations of the reduction, 2 of the force.
    for constant, decaying in (("constant", "decaying"), ("damped_constant", "damped_decaying")):
        assert cost[constant] + 30 <= cost[decaying] <= cost[constant] + 36
