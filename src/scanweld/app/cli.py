"""The command line: thin commands over the library.

Exit codes: 0 good, 1 error, 2 usage (or facts that cannot be about these scans), 3 a verdict other
than good, 130 interrupted.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from scanweld.app.comparison import compare, comparison_table
from scanweld.app.fusion_options import (
    ComponentOption,
    FacesOption,
    HolesOption,
    SmoothOption,
    WatertightOption,
    fusion_settings,
)
from scanweld.app.info import describe_scan
from scanweld.app.job import report_job, run_job
from scanweld.app.json_lines import finished_line
from scanweld.app.memory import parse_size
from scanweld.app.model_commands import export, fuse
from scanweld.app.named_pairs import named_pairs, with_pairs_joined
from scanweld.app.options import (
    NOT_GOOD,
    ConfigFile,
    Force,
    Inputs,
    Json,
    Output,
    Quiet,
    UnitOption,
    Verbose,
    Workers,
)
from scanweld.app.progress import reporting
from scanweld.app.summary import summary
from scanweld.app.workspace import work_folder
from scanweld.config import load_config
from scanweld.errors import BudgetError, KnowledgeError, ScanweldError
from scanweld.evaluation.metrics import Standing
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.simulate import TYPICAL_NOISE
from scanweld.evaluation.simulate import simulate as make_scans
from scanweld.geometry.camera import CameraModel
from scanweld.io import collect, read_mesh, read_poses, read_scan
from scanweld.knowledge.facts import Knowledge, read_knowledge

ERROR = 1
USAGE = 2
INTERRUPTED = 130

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Unordered range scans of an object to one registered, fused 3D model and a verdict.",
)


class Sensor(StrEnum):
    """Cameras of the virtual scanner."""

    PINHOLE = "pinhole"
    ORTHOGRAPHIC = "orthographic"


class MethodName(StrEnum):
    """How poses are found."""

    ROBUST = "robust"
    PAPER = "paper"


Files = Annotated[
    list[str], typer.Argument(metavar="FILES...", help="Scan files, folders or glob patterns.")
]
Memory = Annotated[
    str | None,
    typer.Option(metavar="SIZE", help="Most memory, as 2G or 800M; large scans are thinned."),
]
WithDoubtful = Annotated[
    bool, typer.Option("--with-doubtful", help="Make doubtful scans part of the model too.")
]
MethodOption = Annotated[
    MethodName | None, typer.Option(help="robust (the default), or paper: as published.")
]
Known = Annotated[
    Path | None, typer.Option("--knowledge", help="The five that follow, as a JSON file.")
]
Fix = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="The frame of this scan is the world. Can be repeated."),
]
Start = Annotated[
    Path | None, typer.Option(help="Poses to be tried besides, a poses.json; never just believed.")
]
Together = Annotated[
    list[str] | None,
    typer.Option(metavar="A B", help="Two scans see some of the same surface. Can be repeated."),
]
Apart = Annotated[
    list[str] | None,
    typer.Option(metavar="A B", help="Two scans must not be laid together. Can be repeated."),
]
TurntableFlag = Annotated[
    bool, typer.Option("--turntable", help="All scans turn about one, unknown axis.")
]


@app.command()
def run(
    inputs: Inputs,
    output: Output,
    config: ConfigFile = None,
    workers: Workers = None,
    memory: Memory = None,
    unit: UnitOption = None,
    method: MethodOption = None,
    knowledge: Known = None,
    fix: Fix = None,
    start: Start = None,
    together: Together = None,
    apart: Apart = None,
    turntable: TurntableFlag = False,
    with_doubtful: WithDoubtful = False,
    holes: HolesOption = None,
    component: ComponentOption = None,
    watertight: WatertightOption = False,
    smooth: SmoothOption = None,
    faces: FacesOption = None,
    force: Force = False,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Register and fuse scans: poses, a model and a verdict."""
    settings = load_config(
        config,
        unit=None if unit is None else unit.value,
        method=None if method is None else method.value,
        fusion={
            **fusion_settings(holes, component, watertight, smooth, faces),
            "with_doubtful": with_doubtful or None,
        },
    )
    known = Knowledge(
        fix=tuple(fix or ()),
        start=None if start is None else read_poses(start),
        together=named_pairs("--together", together),
        apart=named_pairs("--apart", apart),
        turntable=turntable,
    )
    if knowledge is not None:
        known = read_knowledge(knowledge).joined(known)
    try:
        with reporting(quiet=quiet, verbose=verbose, as_json=as_json) as progress:
            result = run_job(
                inputs,
                output,
                settings,
                knowledge=known,
                workers=workers,
                memory=None if memory is None else parse_size(memory),
                force=force,
                progress=progress,
            )
    except KeyboardInterrupt:
        kept = work_folder(output)
        remark = f"the same command goes on from {kept}" if kept.exists() else "nothing was written"
        typer.echo(f"scanweld: interrupted; {remark}", err=True)
        raise typer.Exit(INTERRUPTED) from None
    typer.echo(finished_line(result, output) if as_json else summary(result, output))
    raise typer.Exit(result.verdict.exit_code)


@app.command()
def report(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="Folder that run or fuse has made.")
    ],
    scans: Annotated[
        list[str], typer.Option(help="The scans, if they have been moved since.")
    ] = [],  # noqa: B006
) -> None:
    """Write report.html of a finished model folder anew."""
    typer.echo(report_job(model, scans))


@app.command()
def info(files: Files) -> None:
    """Show what was read from scan files, and what was assumed."""
    failed = False
    for file in collect(files):
        try:
            typer.echo(describe_scan(read_scan(file.path, file.name)))
        except ScanweldError as error:
            _print_error(error)
            failed = True
    raise typer.Exit(ERROR if failed else 0)


@app.command()
def simulate(
    mesh: Annotated[Path, typer.Argument(help="The object: a mesh file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="New folder for the scans.")],
    num_scans: Annotated[int, typer.Option(min=2, help="Scans from all around.")] = 10,
    camera: Annotated[Sensor, typer.Option(help="Camera model.")] = Sensor.PINHOLE,
    pixels: Annotated[int, typer.Option(min=20, help="Pixels across the object.")] = 300,
    noise: Annotated[
        float,
        typer.Option(min=0, max=0.1, help="Of depth, in object diameters; 0 for perfect scans."),
    ] = TYPICAL_NOISE.depth_diameters,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
) -> None:
    """Scan a mesh with a virtual scanner; the true poses go to truth/poses.json."""
    model = CameraModel[camera.name]
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
    errors = compare(estimate, truth, scans)
    typer.echo(comparison_table(errors))
    raise typer.Exit(0 if errors.count(Standing.RIGHT) == len(errors.scans) else NOT_GOOD)


app.command()(fuse)
app.command()(export)


def _print_error(error: ScanweldError) -> None:
    typer.echo(f"scanweld: error: {' '.join(str(error).split())}", err=True)


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
        given = sys.argv[1:] if arguments is None else list(arguments)
        app(args=with_pairs_joined(given), prog_name="scanweld")
    except ScanweldError as error:
        _print_error(error)
        sys.exit(USAGE if isinstance(error, (KnowledgeError, BudgetError)) else ERROR)
