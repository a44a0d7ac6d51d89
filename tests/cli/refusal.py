from __future__ import annotations

from click.testing import Result


def assert_refused(result: Result, *fragments: str) -> None:
    """Exit code 2 and one line on standard error that names what is wrong."""
    assert result.exit_code == 2
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("fastmech: ")
    for fragment in fragments:
        assert fragment in lines[0]
