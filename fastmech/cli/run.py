"""``fastmech run``: from a request to a result file."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fastmech.cli.reporting import FILE, NEW_FILE, Account, reporting

if TYPE_CHECKING:
    from fastmech.ensembles.system import System
    from fastmech.models.mechanism import Mechanism
    from fastmech.tiles.run import RunReport


@click.command(name="run")
@click.argument("request_file", metavar="[SCAN.toml]", required=False, type=FILE)
@click.option(
    "--from",
    "source",
    metavar="FILE.h5",
    type=FILE,
    help="Compute a result again: the request is the one that FILE.h5 holds.",
)
@click.option("--out", metavar="FILE.h5", type=NEW_FILE, help="Result file [default: results/SCAN.h5].")
@click.option("--fresh", is_flag=True, help="Start anew; replace the result file if it exists.")
@click.option("--threads", metavar="N", type=click.IntRange(min=1), help="Threads to use [default: all].")
@click.option("--workers", metavar="N", type=click.IntRange(min=1), help="Compute in N processes (Dask).")
@click.option("--scheduler", metavar="ADDRESS", help="Compute on a Dask cluster: tcp://HOST:8786.")
@click.option(
    "--mechanism",
    metavar="FILE.py:NAME",
    help="What the request is about: a mechanism, a system, or a function that gives one.",
)
@click.option("--tile", metavar="SECTION:INDEX", help="Compute one tile alone.")
@click.option("--keep", metavar="FILE.h5", type=NEW_FILE, help="Keep that tile here.")
@reporting
def run(
    told: Account,
    request_file: Path | None,
    source: Path | None,
    out: Path | None,
    fresh: bool,
    threads: int | None,
    workers: int | None,
    scheduler: str | None,
    mechanism: str | None,
    tile: str | None,
    keep: Path | None,
) -> None:
    """Run every scan of a request, write one HDF5 file.

    The request is SCAN.toml, or with --from that of an older result; nothing in a result is executed.
    Finished work is kept: after an interruption the same command goes on.
    """
    if (request_file is None) == (source is None):
        raise click.UsageError("give a request, SCAN.toml, or --from FILE.h5")
    if keep is not None and tile is None:
        raise click.UsageError("--keep needs --tile")
    if workers is not None and scheduler is not None:
        raise click.UsageError("--workers and --scheduler exclude each other")
    text = before = None
    if source is not None:
        request_file, text, before = _asked_in(source, mechanism is not None)
    assert request_file is not None
    with told.bars.preparing():
        from fastmech.runner import run_request
        from fastmech.scan_types.request import RunContext
        from fastmech.tiles.run import default_output

        own = None if mechanism is None else mechanism_named(mechanism)
    context = RunContext(threads, told.bars.stage)
    target = out or default_output(request_file)
    if tile is not None:
        from fastmech.tiles.look import compute_alone

        what: dict[str, Any] = {"text": text, "mechanism": own, "keep": keep}
        alone = compute_alone(request_file, tile, context, target, **what)
        told.facts |= {"tile": tile, "content": alone.content, "same": alone.same}
        told.say(f"{alone.seconds:9.2f} s  {tile}: {alone.work}")
        told.say(f"Content: {alone.content}")
        if alone.same is not None:
            told.say(f"The tile kept beside the result is {'the same' if alone.same else 'ANOTHER ONE'}.")
        if keep is not None:
            told.wrote(keep, "Results: {}")
        return
    from fastmech.tiles.cluster import cluster

    with cluster(workers, scheduler) if workers or scheduler else nullcontext() as dask:
        settings: dict[str, Any] = {"fresh": fresh, "context": context, "workers": dask}
        settings |= {"tell": told.bars.tell, "text": text, "mechanism": own}
        report = run_request(request_file, target, **settings)
    told.done = str(target)
    told.facts |= report.summary()
    _show(told, report)
    if before is not None:
        from fastmech.tiles.section import asked_of_result, differences

        now = asked_of_result(report.path)
        if now is not None and now != before:
            told.say(f"Bits may differ from the older result: {differences(before, now)}")


def mechanism_named(where: str) -> Mechanism | System:
    """A mechanism or a system by file and name.

    Raises:
        InputError: there is none.
    """
    from fastmech.ensembles.system import System
    from fastmech.errors import InputError, shown_name
    from fastmech.models.mechanism import Mechanism
    from fastmech.scan_types.request import named_in_file

    found = named_in_file(where, "--mechanism")
    if not isinstance(found, Mechanism | System):
        file, _, name = map(shown_name, where.rpartition(":"))
        raise InputError(f"{file}: {name} is no fastmech.Mechanism or System, nor gives one")
    return found


def _asked_in(source: Path, given: bool) -> tuple[Path, str, str | None]:
    """Name and text of the request that a result was made from, and all that decided its values.

    Raises:
        InputError: there is no request, or it is about a mechanism of the user's own and none is given.
    """
    from fastmech.store.read import open_results
    from fastmech.tiles.section import asked_of_result, require_named

    with open_results(source) as results:
        name = Path(str(results.attrs.get("request_file", ""))).name
        plain = "".join(c if c.isalnum() or c in "._- " else "_" for c in name)
        before, text = asked_of_result(source), results.request
    if not given:
        require_named(before, text, source)
    return Path(plain or source.name), text, before


def _show(told: Account, report: RunReport) -> None:
    from fastmech.store.read import open_results

    target = report.path
    seconds = {str(stage["name"]).partition(":")[0]: stage["seconds"] for stage in told.bars.stages()}
    with open_results(target) as results:
        for name in results:
            if not report.was_complete:
                told.say(f"{seconds.get(name, results[name].attrs['wall_time_s']):9.2f} s  {name}")
            for about in ("failures", "left_range"):
                if line := results[name].attrs.get(about):
                    told.say(f"fastmech: {name}: {line}", err=True)
    if report.was_complete:
        told.say(f"{target} holds this result already; --fresh computes it again")
    else:
        told.say(f"{told.seconds:9.2f} s  in all, {told.bars.prepared:.2f} s of it loading and compiling")
    told.say(f"Results: {target}")
    told.say(f"Next:    fastmech info {target}")
    told.say(f"         fastmech plot {target}")
