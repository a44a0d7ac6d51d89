"""``fastmech explore``: a page on this machine on which a mechanism is dragged and everything follows."""

from __future__ import annotations

import click

from fastmech.errors import InputError


@click.command(name="explore")
@click.argument("what", metavar="[SCENE.toml | MECHANISM | RESULT.h5]", required=False)
@click.option(
    "--port", metavar="N", type=click.IntRange(0, 65535), default=0, help="Port [default: a free one]."
)
@click.option("--no-browser", is_flag=True, help="Only print the page's address.")
def explore(what: str | None, port: int, no_browser: bool) -> None:
    """Explore a mechanism live, on a page in the browser.

    MECHANISM is the name of a shipped one, or FILE.py:NAME; by default it is the paper's with Table 1. The
    page is served to this machine only. Ctrl-C ends it.
    """
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
        import websockets  # noqa: F401
    except ImportError:
        raise InputError(
            "explore: needs starlette, uvicorn and websockets; install them with:"
            " pip install 'fastmech[explore]'"
        ) from None
    from fastmech.explore.device import open_device
    from fastmech.explore.serve import serve

    def ready(address: str) -> None:
        click.echo(f"fastmech: {address} (Ctrl-C ends)")
        if not no_browser:
            import webbrowser

            webbrowser.open(address)

    serve(open_device(what), port, ready)
