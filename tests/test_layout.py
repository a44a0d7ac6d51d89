"""The package's shape: data flows one way, compiled code keeps to its places."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from fastmech.kernel_cache import COMPILED, PACKAGE, source_files
from fastmech.tiles.section import _SOURCES

#: Each layer may import itself and the ones before it; a part of a folder may be a layer of its own.
LAYERS = (
    "arrays",
    "errors",
    "objects",
    "interrupts",
    "kernel_cache",
    "compiling",
    "generated",
    "callee",
    "jit",
    "scene",
    "samplers",
    "outcome",
    "slider",
    "kernels",
    "slider.kernels",
    "intervals",
    "integrators",
    "loads",
    "models",
    "mechanisms",
    "step_limits",
    "ensembles",
    "models.motion",
    "slider.motion",
    "slider.balance",
    "transients",
    "capture.cells",
    "capture.passes",
    "capture.wells",
    "atlas",
    "slider.atlas",
    "atlas.snap",
    "disturbance",
    "capture",
    "slider.capture",
    "capture.select",
    "attractors",
    "basins",
    "results",
    "store",
    "system_info",
    "plots",
    "frontier",
    "scan_types",
    "tiles",
    "runner",
    "reports",
    "device_report",
    "explore",
    "studies",
    "cli",
    "__main__",
)

#: A scene under another load is a mechanism, which is made where one is asked for, and what the engine is
#: told of its motions is made for a run; results become datasets.
UPWARD = {
    ("scene.py", "mechanisms"),
    ("scene.py", "slider"),
    ("scene.py", "slider.motion"),
    ("mechanism.py", "models.motion"),
    ("objects.py", "results"),
}

MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")

EVERY_MODULE = pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))


def layer(path: Path) -> str:
    return layer_of(".".join(path.relative_to(PACKAGE).with_suffix("").parts))


def layer_of(module: str) -> str:
    """The layer of a module of the package: the longest one that its name begins with."""
    known = [one for one in LAYERS if f"{module}.".startswith(f"{one}.")]
    return max(known, key=len, default=module.split(".")[0])


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imported(code: ast.Module) -> Iterator[str]:
    """Layers of fastmech that a module imports, wherever in it; the package itself is ``""``."""
    for node in ast.walk(code):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            module = node.module or ""
            names = [f"{module}.{alias.name}" for alias in node.names] if module == "fastmech" else [module]
        for name in names:
            if name.split(".")[0] == "fastmech":
                yield layer_of(name.removeprefix("fastmech").removeprefix("."))


def decorators(code: ast.Module) -> set[str]:
    """Names of everything that decorates a function, called or not."""
    found = set()
    for node in ast.walk(code):
        if isinstance(node, ast.FunctionDef):
            for decorator in node.decorator_list:
                target = decorator.func if isinstance(decorator, ast.Call) else decorator
                found.add(target.attr if isinstance(target, ast.Attribute) else getattr(target, "id", ""))
    return found


def is_compiled(path: Path) -> bool:
    return path.relative_to(PACKAGE).parts[0] in COMPILED


def test_every_layer_is_known() -> None:
    assert {layer(path) for path in MODULES} <= set(LAYERS)


@EVERY_MODULE
def test_imports_point_one_way(path: Path) -> None:
    mine = LAYERS.index(layer(path))
    for other in imported(tree(path)):
        if other in ("", "__version__"):  # the package's own names: only where a user's command starts
            assert layer(path) in ("cli", "studies", "store"), path
        elif (path.name, other) not in UPWARD:
            assert LAYERS.index(other) <= mine, f"{path} imports {other}"


def test_the_engine_knows_no_mechanism() -> None:
    """What one adds it is told by the scene, see :class:`fastmech.ensembles.fitting.Moving`."""
    for path in MODULES:
        if path.relative_to(PACKAGE).parts[0] in ("kernels", "integrators", "step_limits", "ensembles"):
            assert not any(name.startswith("slider") for name in imported(tree(path))), path


def test_the_test_sees_imports_inside_functions_and_conditions() -> None:
    code = ast.parse("def f():\n    from fastmech.store.read import x\nif a:\n    import fastmech.plots\n")
    assert sorted(imported(code)) == ["plots", "store"]


def test_no_cycles_inside_a_layer() -> None:
    """Modules of the same layer import each other in one direction too."""
    edges: dict[str, set[str]] = {}
    for path in MODULES:
        name = ".".join(("fastmech", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
            ".__init__"
        )
        edges[name] = {
            node.module
            for node in tree(path).body
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("fastmech")
        }
    done: set[str] = set()

    def visit(name: str, above: tuple[str, ...]) -> None:
        assert name not in above, f"cycle: {' -> '.join((*above, name))}"
        if name not in done:
            for other in edges.get(name, ()):
                visit(other, (*above, name))
            done.add(name)

    for name in edges:
        visit(name, ())


@EVERY_MODULE
def test_compiled_places_import_compiled_places_only(path: Path) -> None:
    """Else an edit elsewhere could change a kernel and leave its cached machine code in use."""
    if is_compiled(path):
        allowed = {name.removesuffix(".py") for name in COMPILED} | {
            "scene",
            "samplers",
            "errors",
            "objects",
            "interrupts",
            "kernel_cache",
            "compiling",
        }
        assert {other.split(".")[0] for other in imported(tree(path))} <= allowed


def test_whatever_a_scan_computes_with_decides_its_identity() -> None:
    """Kept tiles of other sources are not continued; what only tells, shows or writes may change."""
    apart = {"", "errors", "objects", "interrupts", "kernel_cache", "compiling", "store", "plots"}
    reached: set[str] = set()
    more = {"scan_types"}
    while more - reached:
        reached |= more
        more = {other for path in MODULES if layer(path) in reached for other in imported(tree(path))} - apart
    assert {one.split(".")[0] for one in reached} <= {source.removesuffix(".py") for source in _SOURCES}


@EVERY_MODULE
def test_cached_kernels_lie_in_compiled_places(path: Path) -> None:
    """What is decorated by ``kernel`` or ``inlined`` is kept on disk or reaches what is."""
    if decorators(tree(path)) & {"kernel", "inlined", "inlined_exactly"}:
        assert is_compiled(path)


def test_compiled_places_exist_and_hold_kernels() -> None:
    for name in COMPILED:
        assert (PACKAGE / name).exists()
    sources = source_files()
    assert sources == sorted(path for path in MODULES if is_compiled(path))
    assert PACKAGE / "jit.py" in sources
    assert (
        sum(bool(decorators(tree(path)) & {"kernel", "inlined", "inlined_exactly"}) for path in sources) >= 10
    )


COMPILING = {"kernel", "called", "inlined", "inlined_exactly"}


@EVERY_MODULE
def test_compiled_functions_take_few_arguments_and_no_slices(path: Path) -> None:
    """Of many arguments two of a type change places unseen; a slice makes the compiler write messages."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.FunctionDef) and decorators(ast.Module([node], [])) & COMPILING:
            assert len(node.args.args) <= 8, node.name
            assert not any(isinstance(inside, ast.Slice) for inside in ast.walk(node)), node.name


@EVERY_MODULE
def test_calls_have_few_positional_arguments(path: Path) -> None:
    """But the types of a kernel's arguments."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Call) and ast.unparse(node.func) != "types.void":
            assert len(node.args) <= 5, f"{node.lineno}: {ast.unparse(node.func)}"


@EVERY_MODULE
def test_imports_are_seen(path: Path) -> None:
    """A literal name given to ``import_module`` hides an import from the type checker and from this file."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "import_module":
            assert not isinstance(node.args[0], ast.Constant), ast.unparse(node)


@EVERY_MODULE
def test_only_one_module_decides_what_is_cached(path: Path) -> None:
    """``cache=True`` appears in jit.py alone, where the cache directory is set."""
    calls = [node for node in ast.walk(tree(path)) if isinstance(node, ast.Call)]
    cached = [call for call in calls for keyword in call.keywords if keyword.arg == "cache"]
    assert not cached or path == PACKAGE / "jit.py"


def is_overload(node: ast.FunctionDef | ast.ClassDef) -> bool:
    return any(getattr(d, "id", "") == "overload" for d in node.decorator_list)


@EVERY_MODULE
def test_modules_and_public_functions_are_described(path: Path) -> None:
    code = tree(path)
    assert ast.get_docstring(code), "module"
    for node in code.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            assert is_overload(node) or ast.get_docstring(node), node.name
            methods = node.body if isinstance(node, ast.ClassDef) else []
            for method in methods:
                if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
                    assert is_overload(method) or ast.get_docstring(method), f"{node.name}.{method.name}"


@EVERY_MODULE
def test_annotations_are_postponed(path: Path) -> None:
    code = tree(path)
    if len(code.body) > 1:  # more than a docstring
        assert any(isinstance(node, ast.ImportFrom) and node.module == "__future__" for node in code.body)


#: Modules of general folders that name the paper's angles or parameters, none but for a reason: the default
#: load of a scene's snap, the map over its own force and the picture of that, which states a scene's runs
#: have, and how pictures write Greek letters.
KNOWING = {
    "atlas": {"snap.py"}, "attractors": set(), "basins": {"snapping.py"}, "capture": set(),
    "ensembles": {"integrate.py"}, "integrators": set(), "intervals": set(), "kernels": set(),
    "models": set(), "plots": {"basins.py", "style.py"}, "store": set(), "tiles": set(), "transients": set(),
}  # fmt: skip


@pytest.mark.parametrize("folder", KNOWING)
def test_few_general_modules_know_the_paper_s_mechanism(folder: str) -> None:
    paths = (PACKAGE / folder).rglob("*.py")
    naming = {path.name for path in paths if re.search(r"\b(phi|theta|F0|c1)\b", path.read_text("utf-8"))}
    assert naming == KNOWING[folder]


def test_no_two_classes_share_a_name() -> None:
    homes: dict[str, list[str]] = {}
    for path in MODULES:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(str(path.relative_to(PACKAGE)))
    assert {name: where for name, where in homes.items() if len(where) > 1} == {}


def test_tests_lie_in_folders_of_what_they_test() -> None:
    tests = Path(__file__).parent
    for path in tests.rglob("test_*.py"):
        assert (PACKAGE / path.parent.relative_to(tests)).is_dir(), path
