"""Options that several commands share."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

NOT_GOOD = 3
"""Exit code of a result that is less than it could be."""


class LengthUnit(StrEnum):
    """What the scans' coordinates are measured in."""

    M = "m"
    CM = "cm"
    MM = "mm"
    IN = "in"


Inputs = Annotated[
    list[str], typer.Argument(metavar="INPUTS...", help="Scan files, folders or glob patterns.")
]
Output = Annotated[Path, typer.Option("-o", "--output", help="Folder to be made.")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="Settings, a TOML file.")]
Workers = Annotated[int | None, typer.Option(min=1, help="Threads; all cores if not given.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an output that is there already.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Warnings only, no progress.")]
Json = Annotated[
    bool, typer.Option("--json", help="Tell of progress and the verdict as JSON, a line an event.")
]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="A detailed log.")]
UnitOption = Annotated[LengthUnit | None, typer.Option(help="Unit of the scans' coordinates.")]
