"""What a run of a request has done."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class RunReport:
    """What a run has done.

    Attributes:
        path: the result file.
        tiles: tiles in all.
        computed: tiles that this run has computed.
        damaged: files of tiles that were found damaged and computed again.
        was_complete: whether there was nothing to do.
        seconds: wall time of this run [s].
    """

    path: Path
    tiles: int = 0
    computed: int = 0
    damaged: list[Path] = field(default_factory=list)
    was_complete: bool = False
    seconds: float = 0.0

    def summary(self) -> dict[str, str | int | bool | list[str]]:
        """The same as plain values, for other programs."""
        return {
            "result": str(self.path),
            "tiles": self.tiles,
            "computed": self.computed,
            "damaged": [str(path) for path in self.damaged],
            "was_complete": self.was_complete,
        }
