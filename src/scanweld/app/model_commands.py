"""Commands around models and poses: ``fuse`` and ``export``."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from scanweld.app.export import Wanted
from scanweld.app.export import export as export_model
from scanweld.app.fuse import fuse_job
from scanweld.app.fusion_options import (
    ComponentOption,
    FacesOption,
    HolesOption,
    SmoothOption,
    WatertightOption,
    fusion_settings,
)
from scanweld.app.json_lines import finished_line
from scanweld.app.options import (
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
from scanweld.config import load_config


class PoseFormatName(StrEnum):
    """Formats of poses."""

    CONF = "conf"
    MLP = "mlp"
    ALN = "aln"
    TUM = "tum"
    COLMAP = "colmap"
    OPEN3D = "open3d"
    CLOUDCOMPARE = "cloudcompare"
    NERFSTUDIO = "nerfstudio"


class ModelFormatName(StrEnum):
    """Formats of meshes."""

    PLY = "ply"
    OBJ = "obj"
    STL = "stl"
    GLB = "glb"


class UpAxis(StrEnum):
    """Axes that may point up."""

    X = "x"
    Y = "y"
    Z = "z"
    MINUS_X = "-x"
    MINUS_Y = "-y"
    MINUS_Z = "-z"


PosesFile = Annotated[
    Path, typer.Option("--poses", help="Poses of the scans, in any format that export writes.")
]


def fuse(
    inputs: Inputs,
    poses: PosesFile,
    output: Output,
    config: ConfigFile = None,
    workers: Workers = None,
    unit: UnitOption = None,
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
    """Fuse scans whose poses are known; exit code 3 if some had to be left out."""
    settings = load_config(
        config,
        unit=None if unit is None else unit.value,
        fusion=fusion_settings(holes, component, watertight, smooth, faces),
    )
    with reporting(quiet=quiet, verbose=verbose, as_json=as_json) as progress:
        result = fuse_job(
            inputs, poses, output, settings, workers=workers, force=force, progress=progress
        )
    typer.echo(finished_line(result, output) if as_json else summary(result, output))
    raise typer.Exit(result.verdict.exit_code)


def export(
    model_dir: Annotated[Path, typer.Argument(help="A folder that run or fuse has made.")],
    output: Output,
    poses: Annotated[list[PoseFormatName], typer.Option(help="Poses; may be repeated.")] = [],  # noqa: B006
    model: Annotated[list[ModelFormatName], typer.Option(help="The mesh; may be repeated.")] = [],  # noqa: B006
    points: Annotated[
        str | None, typer.Option(metavar="NAME.ply", help="All points, with their scan's number.")
    ] = None,
    scans: Annotated[
        list[str], typer.Option(help="The scans, if they have been moved since.")
    ] = [],  # noqa: B006
    component: Annotated[int, typer.Option(min=1, help="Which component, if several.")] = 1,
    unit: UnitOption = None,
    up: Annotated[UpAxis, typer.Option(help="The model's axis that points up, for GLB.")] = (
        UpAxis.Y
    ),
    force: Force = False,
) -> None:
    """Write a model, its poses and points in the formats of other tools."""
    wanted = Wanted(
        poses=[form.value for form in poses],
        models=[form.value for form in model],
        points=points,
        component=component,
        unit=None if unit is None else unit.value,
        up=up.value,
    )
    lines = export_model(model_dir, output, wanted, scans=scans, force=force)
    typer.echo("\n".join(lines))
