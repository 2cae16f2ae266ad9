"""The command line: thin commands over the library; its exit codes are those of ``ExitCode``."""

import gc
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from scanweld.app import cache_commands
from scanweld.app.model_commands import export, fuse, report, run
from scanweld.app.named_pairs import with_pairs_joined
from scanweld.app.options import DepthOptions, takes, without_collecting
from scanweld.errors import BudgetError, ExitCode, InputError, KnowledgeError, ScanweldError

# What only one command needs is imported inside it: help and small commands then start at once.

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Unordered range scans of an object to one registered, fused 3D model and a verdict.",
)
app.command()(run)
app.command()(report)


@dataclass(frozen=True, kw_only=True)
class InfoOptions:
    """What ``info`` takes."""

    files: Annotated[
        list[str], typer.Argument(metavar="FILES...", help="Scan files, folders or glob patterns.")
    ]
    depth: DepthOptions
    html: Annotated[
        Path | None, typer.Option(help="Write a page with pictures of depth frames to this file.")
    ] = None


@app.command()
@takes(InfoOptions)
@without_collecting()
def info(options: InfoOptions) -> None:
    """Show what was read from scan files, and what was assumed."""
    from scanweld.io.depth.capture import DepthImages, collect_named
    from scanweld.preparation.info import describe_scan
    from scanweld.work.threads import single_threaded_algebra

    failed = False
    named = options.depth.named(options.files)
    with single_threaded_algebra():  # to wake threads takes longer than what they would do
        files = collect_named(named)
        if isinstance(named, DepthImages):
            from scanweld.app.capture_page import describe_capture

            more = f" and {len(options.files) - 1} more" * (len(options.files) > 1)
            typer.echo(describe_capture(files, options.files[0] + more, options.html))
        elif options.html is not None:
            raise InputError("--html shows depth images; these are other scans: leave it out")
        for file in files:
            try:
                typer.echo(describe_scan(file.read()))
            except ScanweldError as error:
                _print_error(error)
                failed = True
    raise typer.Exit(ExitCode.ERROR if failed else ExitCode.GOOD)


@app.command()
def formats() -> None:
    """List the formats of scans that can be read, and what a scan gets from each."""
    from scanweld.io.scan_formats.registry import format_rows

    for suffixes, title, kept in format_rows():
        typer.echo(f"{suffixes}\n    {title}\n    kept besides points: {kept}")


@app.command()
def simulate(
    mesh: Annotated[Path, typer.Argument(help="The object: a mesh file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="New folder for the scans.")],
    num_scans: Annotated[int, typer.Option(min=2, help="Scans from all around.")] = 10,
    camera: Annotated[
        Literal["pinhole", "orthographic"], typer.Option(help="Camera model.")
    ] = "pinhole",
    pixels: Annotated[int, typer.Option(min=20, help="Pixels across the object.")] = 300,
    noise: Annotated[
        float,
        typer.Option(min=0, max=0.1, help="Of depth, in object diameters; 0 for perfect scans."),
    ] = 5e-4,  # that of TYPICAL_NOISE
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
) -> None:
    """Scan a mesh with a virtual scanner; the true poses go to truth/poses.json."""
    from dataclasses import replace

    from scanweld.evaluation.scanner import NoiseModel
    from scanweld.evaluation.simulate import TYPICAL_NOISE
    from scanweld.evaluation.simulate import simulate as make_scans
    from scanweld.geometry.camera import CameraModel
    from scanweld.io import read_mesh

    model = CameraModel[camera.upper()]
    noisy = replace(TYPICAL_NOISE, depth_diameters=noise) if noise else NoiseModel()
    truth = make_scans(
        read_mesh(mesh),
        output,
        num_scans=num_scans,
        model=model,
        pixels=pixels,
        noise=noisy,
        seed=seed,
    )
    typer.echo(f"{output}: {len(truth.poses)} scans, and truth/poses.json")


@app.command()
def evaluate(
    estimate: Annotated[Path, typer.Argument(help="poses.json of a run.")],
    truth: Annotated[Path, typer.Argument(help="True poses: the same format, or {name: 4x4}.")],
    scans: Annotated[
        list[str], typer.Option(help="The scans: errors are then in percent of the diameter.")
    ] = [],  # noqa: B006
) -> None:
    """Compare poses with the truth; exit code 3 unless all scans are right."""
    from scanweld.evaluation.comparison import compare, comparison_table
    from scanweld.evaluation.metrics import Standing

    errors = compare(estimate, truth, scans)
    typer.echo(comparison_table(errors))
    all_right = errors.count(Standing.RIGHT) == len(errors.scans)
    raise typer.Exit(ExitCode.GOOD if all_right else ExitCode.NOT_GOOD)


app.command()(fuse)
app.command()(export)
app.add_typer(cache_commands.app, name="cache")


def _print_error(error: ScanweldError) -> None:
    typer.echo(f"scanweld: error: {' '.join(str(error).split())}", err=True)


def _print_version(wanted: bool) -> None:
    from importlib.metadata import version

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
    given = sys.argv[1:] if arguments is None else list(arguments)
    try:
        app(args=with_pairs_joined(given), prog_name="scanweld")
    except ScanweldError as error:
        _print_error(error)
        is_usage = isinstance(error, (KnowledgeError, BudgetError))
        sys.exit(ExitCode.USAGE if is_usage else ExitCode.ERROR)
    except OSError as error:  # of names that are too long, or folders that cannot be entered
        if error.filename is None:
            raise
        _print_error(InputError(f"{error.filename}: {error.strerror}; check the path"))
        sys.exit(ExitCode.ERROR)
    finally:
        if arguments is None:
            gc.freeze()  # the process ends: to look through all its modules took 0.3 s
