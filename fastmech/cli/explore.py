"""``fastmech explore``: a page on this machine on which a mechanism is dragged and everything follows."""

from __future__ import annotations

import json
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
@click.option("--mechanism", "own", metavar="FILE.py:NAME", help="Your own, with the file's values.")
@click.option("--port", metavar="N", type=click.IntRange(0, 65535), default=0, help="Port [default: free].")
@click.option("--no-browser", is_flag=True, help="Only print the page's address.")
def explore(what: str | None, own: str | None, port: int, no_browser: bool) -> None:
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

    serve(opened(what, own), port, ready)


def opened(what: str | None, own: str | None = None) -> Device:
    """What the command's argument stands for, of one's own mechanism if one is given; None is Table 1.

    Raises:
        InputError: there is no such thing.
    """
    from fastmech.explore.device import Device
    from fastmech.scene import Scene, parse_toml, read_toml

    if not what and not own:
        return Device(Scene())  # before the libraries are there
    from fastmech.cli.run import mechanism_named
    from fastmech.models.mechanism import Mechanism
    from fastmech.scan_types.request import device_of

    own, what = (what, "") if what and ":" in what and not own else (own, what or "")
    made, results = mechanism_named(own) if own else None, None
    if not isinstance(made, Mechanism | None):
        raise InputError(f"{own}: is a System, which has no drawing; give a Mechanism")
    table: dict[str, Any] = {"mechanism": what} if what else {}
    if what.endswith((".h5", ".hdf5")):
        from fastmech.store.read import open_results
        from fastmech.tiles.section import asked_of_result

        with open_results(what) as found:
            table, results = parse_toml(found.request, what), Path(what)
        asked = json.loads(asked_of_result(results) or "{}").get("scene", {}).get("equations")
        if "mechanism" not in table and asked != (made and made.prints):
            raise InputError(f"{what}: is of another mechanism; give its own by --mechanism FILE.py:NAME")
    elif what.endswith(".toml"):
        table = read_toml(what)
        if "scan" in table:  # which tell whether the file is of this mechanism
            from fastmech.scan_types import scan_kinds
            from fastmech.scan_types.request import read_request

            try:
                read_request(what, scan_kinds(), mechanism=made)
            except InputError as error:
                by_option = "; its mechanism is given by --mechanism FILE.py:NAME"
                hint = "" if made or "mechanism" in table else by_option
                raise InputError(f"{what}: {error}{hint}") from None
    source = str(Path(own).resolve()) if own else table.get("mechanism")  # for lines that are run elsewhere
    return Device(device_of(table, made), source, results)
