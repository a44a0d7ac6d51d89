"""What the compiler makes of kernels for other processors: whole vectors, in either precision."""

from __future__ import annotations

import platform
import re

import llvmlite.binding as llvm
import pytest
from kernels.machine_code import KERNELS, MOTIONS, PROCESSORS, machine_code, told_for
from kernels.test_compiled_code import basic_blocks

pytestmark = pytest.mark.skipif(
    platform.machine().lower() not in ("x86_64", "amd64"), reason="no compiler for x86-64 here"
)


@pytest.mark.parametrize("processor", PROCESSORS)
@pytest.mark.slow
def test_loops_over_lanes_are_as_wide_as_the_vectors(processor: str) -> None:
    """One stretch of every kernel takes whole vectors of its precision, converts nothing and calls nobody."""
    code, bits = machine_code(processor), PROCESSORS[processor][2]
    register = {256: "y", 512: "z"}[bits]
    for kernel, least in KERNELS.items():
        own, other = ("s", "d") if kernel.endswith("float32") else ("d", "s")
        packed = re.compile(rf"\bv(?:f?n?m(?:add|sub)\d*|add|sub|mul)\w*p{own}\s.*%{register}mm")
        loops = [b for b in basic_blocks(code[kernel]) if len(packed.findall(b)) >= least]
        assert loops, kernel
        foreign = re.compile(
            rf"\bcall|\bvcvt\w*[ps][sd]2[ps][sd]|\bv(?:f?n?m(?:add|sub)\d*|mul)\w*[ps]{other}\s"
        )
        assert not any(foreign.search(loop) for loop in loops), kernel


@pytest.mark.skipif(
    not llvm.get_host_cpu_features().get("avx512f", False), reason="no 512-bit vectors on this processor"
)
@pytest.mark.slow
def test_bits_of_motions_do_not_depend_on_the_width() -> None:
    assert told_for("skylake-avx512 with 256 bit", MOTIONS) == told_for("haswell", MOTIONS)
