"""``fastmech plot``: a result file as pictures."""

from __future__ import annotations

from pathlib import Path

import click

from fastmech.cli.reporting import account, out_option, reporting_options, section_option


@click.command(name="plot")
@click.argument("file", metavar="FILE", type=click.Path(path_type=Path))
@out_option("Folder for the pictures [default: FILE without its ending].")
@section_option("Only this section.")
@click.option(
    "--format", "form", type=click.Choice(["png", "pdf", "svg"]), default="png", help="Format [default: png]."
)
@reporting_options
def command(file: Path, out: Path | None, section: str | None, form: str, quiet: bool, as_json: bool) -> None:
    """Draw every section of a result file as pictures."""
    from fastmech.store.read import open_results

    with account("plot", quiet, as_json) as told:
        with open_results(file) as results:  # before kernels are compiled, which may take a minute
            if section is not None:
                results[section]  # says what there is
        with told.bars.preparing():
            from fastmech.runner import draw_results
        for picture in draw_results(file, out, stage=told.bars.stage, section=section, form=form):
            told.wrote(picture)
