"""The command line asks for 512-bit vectors where LLVM would not use them; the library changes nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from fastmech.cli import vectors

pytestmark = pytest.mark.nojit


class Features(dict):
    def flatten(self):
        return ",".join(f"{'+' if on else '-'}{name}" for name, on in self.items())


@pytest.fixture
def processor(monkeypatch):
    """A processor of a name, seen before Numba is imported; what it makes of the environment."""

    def pretend(name, *, wide=True, machine="x86_64", **environment):
        from llvmlite import binding

        own = dict(environment)
        monkeypatch.setattr(vectors.os, "environ", own)
        monkeypatch.delitem(sys.modules, "numba", raising=False)
        monkeypatch.setattr(vectors.platform, "machine", lambda: machine)
        monkeypatch.setattr(binding, "get_host_cpu_name", lambda: name)
        monkeypatch.setattr(binding, "get_host_cpu_features", lambda: Features(avx2=True, avx512f=wide))
        vectors.ask_for_wide_vectors()
        return own

    return pretend


def test_asked_for_where_llvm_prefers_narrow_ones(processor):
    assert processor("icelake-server") == {vectors.FEATURES: "+avx2,+avx512f,-prefer-256-bit"}
    assert "asked for by this command" in vectors.reason(512)


@pytest.mark.parametrize(
    ("name", "options"),
    [("znver4", {}), ("icelake-server", {"wide": False}), ("apple-m1", {"machine": "arm64"})],
)
def test_nothing_is_asked_for_elsewhere(processor, name, options):
    assert processor(name, **options) == {}


@pytest.mark.parametrize("variable", [vectors.NAME, vectors.FEATURES])
def test_what_the_user_has_set_stays(processor, variable):
    assert processor("icelake-server", **{variable: "haswell"}) == {variable: "haswell"}
    assert vectors.reason(256) == "as NUMBA_CPU_NAME and NUMBA_CPU_FEATURES say"


def test_nothing_is_asked_for_once_numba_is_there(monkeypatch):
    monkeypatch.setattr(vectors.os, "environ", {})
    monkeypatch.setitem(sys.modules, "numba", sys)
    vectors.ask_for_wide_vectors()
    assert vectors.os.environ == {}


STATE = """
import json, os, signal, sys, threading, warnings, locale
def state():
    return [dict(os.environ), [str(signal.getsignal(s)) for s in (signal.SIGINT, signal.SIGTERM)],
            threading.active_count(), len(warnings.filters), locale.setlocale(locale.LC_ALL), os.getcwd(),
            sys.path, sys.getrecursionlimit(), str(sys.excepthook)]
def numba_state():
    from numba import config
    return [config.CACHE_DIR, config.CPU_NAME, config.CPU_FEATURES]
import numpy, numba, scipy.optimize, pydantic
before, ours = state(), numba_state()
errors = numpy.geterr()
import fastmech as fm
fm.integrate
fm.Scene
print(json.dumps([before == state(), ours == numba_state(), errors == numpy.geterr()]))
"""


def test_importing_the_library_changes_nothing_of_the_process():
    done = subprocess.run(
        [sys.executable, "-c", STATE], capture_output=True, text=True, check=True, env=os.environ
    )
    assert json.loads(done.stdout) == [True, True, True]
