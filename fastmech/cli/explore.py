"""``fastmech explore``: a page on this machine on which a mechanism is dragged and everything follows."""

from __future__ import annotations

import threading
import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fastmech.errors import InputError

if TYPE_CHECKING:
    from fastmech.explore.device import Device


@click.command(name="explore")
@click.argument("what", metavar="[SCENE.toml | MECHANISM | RESULT.h5]", required=False)
@click.option("--port", metavar="N", type=click.IntRange(0, 65535), default=0, help="Port [default: free].")
@click.option("--no-browser", is_flag=True, help="Only print the page's address.")
def explore(what: str | None, port: int, no_browser: bool) -> None:
    """Explore a mechanism live, on a page in the browser.

    MECHANISM is the name of a shipped one, or FILE.py:NAME; by default it is the paper's with Table 1. The
    page is served to this machine only. Ctrl-C ends it.
    """
    if missing := [one for one in ("starlette", "uvicorn", "websockets") if find_spec(one) is None]:
        raise InputError(f"explore: needs {', '.join(missing)}; install: pip install 'fastmech[explore]'")
    from fastmech.explore.serve import serve

    def ready(address: str) -> None:
        click.echo(f"fastmech: {address} (Ctrl-C ends)")
        if not no_browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    serve(opened(what), port, ready)


def opened(what: str | None) -> Device:
    """What the command's argument stands for; None is Table 1.

    Raises:
        InputError: there is no such thing.
    """
    from fastmech.explore.device import Device
    from fastmech.scene import Scene, parse_toml, read_toml

    what, results = what or "", None
    table: dict[str, Any] = {"mechanism": what} if what else {}
    if what.endswith((".h5", ".hdf5")):
        from fastmech.store.read import open_results

        with open_results(what) as found:
            table, results = parse_toml(found.request, what), Path(what)
    elif what.endswith(".toml"):
        table = read_toml(what)
    elif ":" in what:
        from fastmech.cli.run import mechanism_named
        from fastmech.models.mechanism import Mechanism

        made = mechanism_named(what)
        if not isinstance(made, Mechanism):
            raise InputError(f"{what}: is a System, which has no drawing; give a Mechanism")
        return Device(made, what)
    if "mechanism" not in table:
        return Device(Scene(**table.get("scene", {})), None, results)
    from fastmech.scan_types.request import device_of

    return Device(device_of(table), table["mechanism"], results)
