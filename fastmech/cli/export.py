"""``fastmech export``: a result file as CSV, netCDF or npz."""

from __future__ import annotations

from pathlib import Path

import click

from fastmech.cli.reporting import account, out_option, reporting_options, section_option


@click.command(name="export")
@click.argument("file", metavar="FILE.h5", type=click.Path(path_type=Path))
@click.option("--to", "form", type=click.Choice(["csv", "nc", "npz"]), required=True, help="Format.")
@section_option("Only this section.")
@click.option(
    "--variable", "variables", metavar="NAME", multiple=True, help="Only this variable; repeatable."
)
@click.option(
    "--select",
    "selections",
    metavar="NAME=VALUE|LOW:HIGH",
    multiple=True,
    help="The nearest point along a coordinate, or a range (--select F0=-10:10); repeatable.",
)
@out_option("Folder for the files [default: FILE without its ending].")
@click.option("--fresh", is_flag=True, help="Replace files that exist.")
@reporting_options
def command(
    file: Path,
    form: str,
    section: str | None,
    variables: tuple[str, ...],
    selections: tuple[str, ...],
    out: Path | None,
    fresh: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Write a result file in another format.

    Selected values must lie within their coordinate's range; along a dimension without coordinate they are
    places counted from 0. What was taken is told.

    csv: one table for each set of dimensions of a section; nc: netCDF-4, one file for each section (needs
    xarray); npz: one file for each section.
    """
    from fastmech.store.export import export_results

    selected: list[str] = []
    folder = out if out is not None else file.with_suffix("")
    with account("export", quiet, as_json) as told:
        told.facts["selected"] = selected

        def tell(line: str) -> None:
            selected.append(line)
            told.say(line)

        for path in export_results(
            file,
            folder,
            form,
            section=section,
            variables=variables,
            selections=selections,
            replace=fresh,
            stage=told.bars.stage,
            tell=tell,
        ):
            told.wrote(path)
