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
from kernels.blocks_of_lanes import COMBINATIONS, MODULES, kernel, lanes
from numba import float64, int64, none

from fastmech import jit
from fastmech.ensembles.energies import tell_broken
from fastmech.ensembles.highest import highest_energies
from fastmech.integrators.method import Adams
from fastmech.integrators.methods import METHODS as REGISTRY
from fastmech.integrators.sums import TERMS, add_stages
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.integrators.whole import IN_WHOLE_STEPS
from fastmech.jit import INTEGERS, MATRIX, VECTOR
from fastmech.kernels.blocks import DAMPING, DECAY, FORCE
from fastmech.kernels.whole_adams import whole_adams_steps
from fastmech.kernels.whole_steps import whole_step
from fastmech.kernels.work import lagrange_work
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

pytestmark = pytest.mark.skipif(
    not llvm.get_host_cpu_features().get("fma", False),
    reason="no packed fused instructions on this processor",
)

KERNELS = {f"{formulation}-{terms}": kernel(formulation, terms) for formulation, terms in COMBINATIONS}
STEPS = {
    f"{method}-{terms}": whole_step(kernel("lagrange", terms), TABLEAUS[method])
    for method in IN_WHOLE_STEPS
    for terms in ("free", "damped_constant", "damped_decaying")
}
ADVANCES = {
    f"{method.name}-{terms}": whole_adams_steps(kernel("lagrange", terms), method)
    for method, terms in [(m, "damped_constant") for m in REGISTRY.values() if isinstance(m, Adams)]
    + [(REGISTRY["abm8"], "free"), (REGISTRY["abm8"], "damped_decaying")]
}
SHIPPED = {**KERNELS, "work": lagrange_work, **STEPS, **ADVANCES}

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
def test_lanes_are_packed_without_library_calls(name: str) -> None:
    loop = main_loop(SHIPPED[name])
    assert len(VECTOR_ARITHMETIC.findall(loop)) >= 40
    assert not LIBRARY.search(loop)


@pytest.mark.parametrize("name", SHIPPED)
def test_machine_code_of_the_loop(name: str) -> None:
    """The same in machine code: one stretch between labels with packed quadrants and square roots."""
    blocks = basic_blocks(machine_code(SHIPPED[name]))
    loops = [b for b in blocks if re.search(r"\bvpsllq\s.*%[yz]mm", b)]
    loops = [b for b in loops if re.search(r"\bvsqrtpd\s.*%[yz]mm", b)]
    assert loops
    for loop in loops:
        assert len(PACKED.findall(loop)) >= 40
        assert not re.search(r"\bcall", loop)


@pytest.mark.parametrize("shipped", [tell_broken, highest_energies])
def test_passes_over_trajectories_are_packed(shipped: Any) -> None:
    """Their trigonometry is a loop of its own."""
    code = intermediate(shipped)
    assert PACKED_QUADRANT.search(code)
    assert PACKED_ROOT.search(code)
    assert len(VECTOR_ARITHMETIC.findall(code)) >= 80


@pytest.mark.parametrize("start", [VECTOR, none])
def test_stage_sums_are_packed(start: Any) -> None:
    """A pass of one term, of two and so on to the widest; the second pass of a wide sum adds to the first."""
    arguments = (VECTOR, start, MATRIX, float64, INTEGERS, VECTOR, int64, int64)
    compiled = jit.compiled_anew(add_stages, arguments)
    assert len(PACKED.findall("".join(compiled.inspect_asm().values()))) >= sum(range(1, len(TERMS) + 1))


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


@pytest.mark.parametrize(("formulation", "terms"), COMBINATIONS)
def test_only_a_decaying_force_calls_the_exponential(formulation: str, terms: str) -> None:
    calls = re.findall(r"@(?:llvm\.)?exp(?:\.f64)?\(", intermediate(kernel(formulation, terms)))
    assert bool(calls) == ("decaying" in terms)


@pytest.mark.parametrize("formulation", MODULES)
def test_every_term_costs_arithmetic_and_its_absence_none(formulation: str) -> None:
    """Packed operations for each vector of lanes; kernels may be unrolled differently, hence the quotient."""
    cost = {}
    for terms in ("free", "damped", "constant", "damped_constant", "decaying", "damped_decaying"):
        loop = main_loop(kernel(formulation, terms))
        cost[terms] = len(VECTOR_ARITHMETIC.findall(loop)) / len(PACKED_ROOT.findall(loop))
    assert cost["free"] < cost["damped"] < cost["damped_constant"]
    assert cost["free"] < cost["constant"] < cost["damped_constant"]
    # The decay is one factor for each lane; its exponential is outside the loop.
    assert cost["constant"] < cost["decaying"] <= cost["constant"] + 2
    assert cost["damped_constant"] < cost["damped_decaying"] <= cost["damped_constant"] + 2
