"""The command line: thin commands over the library.

Exit codes: 0 good, 1 error, 2 usage, 3 a verdict other than good, 130 interrupted.
"""

import sys
from collections.abc import Sequence
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from scanweld.app.job import run_job
from scanweld.app.progress import reporting
from scanweld.app.summary import summary
from scanweld.app.workspace import work_folder
from scanweld.config import load_config
from scanweld.errors import ScanweldError

INTERRUPTED = 130

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Unordered range scans of an object to one registered, fused 3D model and a verdict.",
)


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
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of everything random.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an output that is there already.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Warnings only, no progress.")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="A detailed log.")]
UnitOption = Annotated[LengthUnit | None, typer.Option(help="Unit of the scans' coordinates.")]


@app.command()
def run(
    inputs: Inputs,
    output: Output,
    config: ConfigFile = None,
    workers: Workers = None,
    seed: Seed = None,
    unit: UnitOption = None,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Register and fuse scans: poses, a model and a verdict."""
    settings = load_config(config, seed=seed, unit=None if unit is None else unit.value)
    try:
        with reporting(quiet=quiet, verbose=verbose) as progress:
            result = run_job(
                inputs, output, settings, workers=workers, force=force, progress=progress
            )
    except KeyboardInterrupt:
        kept = work_folder(output)
        remark = f"the same command goes on from {kept}" if kept.exists() else "nothing was written"
        typer.echo(f"scanweld: interrupted; {remark}", err=True)
        raise typer.Exit(INTERRUPTED) from None
    typer.echo(summary(result, output))
    raise typer.Exit(result.verdict.exit_code)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"scanweld {version('scanweld')}")
        raise typer.Exit()


@app.callback()
def _options(
    _: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Options before the command."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the command ``scanweld``; always leaves by ``SystemExit``."""
    try:
        app(args=None if arguments is None else list(arguments), prog_name="scanweld")
    except ScanweldError as error:
        message = " ".join(str(error).split())
        typer.echo(f"scanweld: error: {message}", err=True)
        sys.exit(1)
