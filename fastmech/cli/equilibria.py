"""``fastmech equilibria``: every resting position of a scene and its stability, as a table."""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fastmech.cli.reporting import FILE, Account, reporting
from fastmech.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

    from fastmech.slider.equilibria import Equilibria, Equilibrium
    from fastmech.slider.stability import Classification


#: Columns that the table needs: in a narrower terminal lines break, but no digit is lost.
LEAST_WIDTH = 84


class _SceneCommand(click.Command):
    """A command with an option for every parameter of a scene."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """The scene's parameters, looked up only now because pydantic is slow to load, then the command's."""
        from fastmech.scene import Scene

        options = [
            click.Option(
                [f"--{name}", name], type=float, metavar="X", help=f"{about} [{unit}; Table 1: {value:g}]"
            )
            for name, (value, unit, about) in Scene().described().items()
        ]
        return [*options, *super().get_params(ctx)]


@click.command(name="equilibria", cls=_SceneCommand)
@click.argument("scene_file", metavar="[SCENE.toml]", required=False, type=FILE)
@click.option(
    "--at",
    metavar="T",
    type=click.FloatRange(min=0.0),
    default=math.inf,
    help="Time at which the force is frozen [s; default: after all decay].",
)
@click.option(
    "--vary",
    metavar="NAME",
    default="F0",
    help="Parameter of which to tell where positions end [default: F0].",
)
@click.option(
    "--position",
    metavar="PHI THETA",
    type=(float, float),
    help="Only for the stable position that is about here [rad; default: for all].",
)
@reporting
def equilibria(
    told: Account,
    scene_file: Path | None,
    at: float,
    vary: str,
    position: tuple[float, float] | None,
    **parameters: float | None,
) -> Callable[[], None]:
    """List every equilibrium of a scene, the paper's mechanism, and its stability.

    For every stable one sentences tell the constant loads F0, or the values of another parameter, at which it
    ends and how hard it may be struck without leaving its well, and one for all says whether the list is
    proved to be complete. The scene is that of SCENE.toml (its table [scene]), else the paper's Table 1; the
    options change it.
    """
    from fastmech.scene import Scene

    try:
        scene = Scene.from_toml(scene_file) if scene_file else Scene()
    except InputError as error:
        other = '; of another mechanism: fastmech run, kind = "equilibria"' * ("unknown name" in str(error))
        raise InputError(f"{error}{other}") from None
    scene = scene.replace(**{name: value for name, value in parameters.items() if value is not None})
    with told.bars.preparing():
        from fastmech.atlas.snap import find_snap, stable_place, stable_places
        from fastmech.basins.shock_limit import proved_limit
        from fastmech.slider.equilibria import find_equilibria, told_force
        from fastmech.slider.impulse import POINTS
        from fastmech.slider.stability import classify
    found, judged = find_equilibria(scene, at), []
    advance = told.bars.stage("stability of equilibria", len(found))
    for equilibrium in found:
        judged.append(classify(scene, equilibrium))
        advance(1)
    loaded = scene.replace(F0=found.force, alpha=0.0)
    here, stable = stable_places(loaded)
    if position is not None:
        stable = [here.index_of(stable_place(loaded, position))]
    lines = [f"{k}: {result.explanation}." for k, result in enumerate(judged)]
    facts, limits = list(map(_facts, found, judged)), []
    advance = told.bars.stage(f"where they end over {vary}", len(stable))
    for k in stable:
        snap = find_snap(loaded, here[k], parameter=vary)
        lines.append(f"{k}: as {'the load ' * (vary == 'F0')}{vary} changes, it {snap.answer}.")
        facts[k] |= {"snap_parameter": vary, "snap_below": snap.below, "snap_above": snap.above}
        with suppress(InputError):  # wells that are not certain have no limits
            bounds = {on: proved_limit(loaded, here[k], on).impulse for on in POINTS}
            limit = {on: size for on, size in bounds.items() if size < math.inf}
            facts[k]["shock_limit"] = limit
            blows = ", ".join(f"{size:.4g} N s on {on}" for on, size in limit.items())
            limits.append(f"{k}: no blow at rest leaves its well with less than {blows}.")
        advance(1)
    sentence = found.certificate.sentence
    told.facts |= {"force": found.force, "certificate": sentence, "equilibria": facts}

    def show() -> None:
        from rich.console import Console

        terminal = shutil.get_terminal_size().columns if sys.stdout.isatty() else 100
        console = Console(width=max(terminal, LEAST_WIDTH), highlight=False)
        console.print(told_force(scene, found.force))
        if judged:
            console.print(_table(found, judged))
        for line in (*lines, *limits, f"{sentence[0].upper()}{sentence[1:]}."):
            console.print(line)

    return show


def _facts(e: Equilibrium, result: Classification) -> dict[str, Any]:
    """An equilibrium for other programs."""
    about: dict[str, Any] = {name: getattr(e, name) for name in ("phi", "theta", "energy", "kind")}
    values = [[value.real, value.imag] for value in map(complex, result.eigenvalues)]
    return about | {"verdict": result.verdict, "eigenvalues": values}


def _table(found: Equilibria, judged: list[Classification]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 1, 0))
    table.add_column("")
    for title in ("phi\nrad\ndeg", "theta\nrad\ndeg", "energy\nJ"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("kind", no_wrap=True)
    table.add_column("eigenvalues\n1/s", justify="right", no_wrap=True)
    table.add_column("Sylvester\nHurwitz\neigenvalues", no_wrap=True)
    table.add_column("joint verdict", style="bold")
    for number, (e, result) in enumerate(zip(found, judged, strict=True)):
        angles = [f"{angle:z.5f}\n{math.degrees(angle):z.3f}" for angle in (e.phi, e.theta)]
        pairs = zip(result.eigenvalues, result.eigenvalue_errors, strict=True)
        values = "\n".join(_complex(value, error) for value, error in pairs if value.imag >= 0.0)
        verdicts = "\n".join(
            f.verdict.replace("asymptotically stable", "asymptotic")
            for f in (result.sylvester, result.hurwitz, result.spectrum)
        )
        cells = [str(number), *angles, f"{e.energy:z.3f}", e.kind, values, verdicts, result.verdict]
        table.add_row(*cells)
    return table


def _complex(value: complex, error: float) -> str:
    """An eigenvalue, a conjugate pair once; a real part that rounding hides is shown as 0."""
    real = f"{value.real:+.4g}" if abs(value.real) > error else "0"
    return f"{real} ± {value.imag:.4g}i" if value.imag else real
