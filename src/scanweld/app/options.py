"""What commands take: options as records, and those that several commands share."""

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from enum import StrEnum
from functools import wraps
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

from scanweld.choices import Holes, Unit

if TYPE_CHECKING:
    from scanweld.io.depth.capture import DepthImages
    from scanweld.reconstruction import Reconstruction
    from scanweld.work.progress import Progress

Options = TypeVar("Options")

Inputs = Annotated[
    list[str], typer.Argument(metavar="INPUTS...", help="Scan files, folders or glob patterns.")
]
Output = Annotated[Path, typer.Option("-o", "--output", help="Folder to be made.")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="Settings, a TOML file.")]
Workers = Annotated[int | None, typer.Option(min=1, help="Threads; all cores if not given.")]
NoCacheOption = Annotated[
    bool,
    typer.Option("--no-cache", help="Neither keep nor use finished work beside the output."),
]
Force = Annotated[bool, typer.Option("--force", help="Replace an output that is there already.")]
UnitOption = Annotated[Unit | None, typer.Option(help="Unit of the scans' coordinates.")]
MovedScans = Annotated[list[str], typer.Option(help="The scans, if they have been moved since.")]

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]


class PoseFormat(StrEnum):
    """Formats of poses."""

    CONF = "conf"
    MLP = "mlp"
    ALN = "aln"
    TUM = "tum"
    COLMAP = "colmap"
    OPEN3D = "open3d"
    CLOUDCOMPARE = "cloudcompare"
    NERFSTUDIO = "nerfstudio"


class MeshFormat(StrEnum):
    """Formats of meshes."""

    PLY = "ply"
    OBJ = "obj"
    STL = "stl"
    GLB = "glb"


@contextmanager
def without_collecting() -> Iterator[None]:
    """Collect no garbage for a while: modules make none, and took a sixth longer to import."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def takes(kind: type[Options]) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Make a function of one record a command as typer wants it: a function of many parameters.

    Args:
        kind: A dataclass. Its fields are the command's arguments and options, in their order; a
            field that is a dataclass itself stands for the fields of that one.
    """

    def command(function: Callable[[Options], None]) -> Callable[..., None]:
        @wraps(function)
        def call(**given: Any) -> None:
            function(_filled(kind, given))

        parameters = list(_parameters(kind))
        call.__annotations__ = {each.name: each.annotation for each in parameters}
        call.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        return call

    return command


def _parameters(kind: Any) -> Iterator[Parameter]:
    for each in fields(kind):
        if is_dataclass(each.type):
            yield from _parameters(each.type)
            continue
        default = Parameter.empty if each.default is MISSING else each.default
        if each.default_factory is not MISSING:
            default = each.default_factory()
        yield Parameter(each.name, Parameter.KEYWORD_ONLY, default=default, annotation=each.type)


def _filled(kind: Any, given: Mapping[str, Any]) -> Any:
    return kind(
        **{
            each.name: _filled(each.type, given) if is_dataclass(each.type) else given[each.name]
            for each in fields(kind)
        }
    )


@dataclass(frozen=True, kw_only=True)
class SurfaceOptions:
    """What the model's surface is to be like."""

    holes: Annotated[
        Holes | None,
        typer.Option(
            help="What no scan saw: open (the default), fill it, or carve by empty space."
        ),
    ] = None
    component: Annotated[
        Literal["all", "largest"] | None,
        typer.Option(help="Pieces to keep: all (the default), or the largest."),
    ] = None
    watertight: Annotated[
        bool,
        typer.Option("--watertight", help="A closed surface; holes are filled unless carved."),
    ] = False
    smooth: Annotated[
        int | None, typer.Option(min=0, max=1000, help="Rounds of smoothing; none if not given.")
    ] = None
    faces: Annotated[
        int | None, typer.Option(min=4, help="Triangles, about; all there are if not given.")
    ] = None

    def settings(self) -> dict[str, Any]:
        """Settings of the section ``fusion``; None, or left out, where an option is not given."""
        return {**vars(self), "watertight": self.watertight or None}


@dataclass(frozen=True, kw_only=True)
class DepthOptions:
    """What is said of depth images."""

    intrinsics: Annotated[
        Path | None, typer.Option(help="Of the camera of depth images: a file, see docs/depth.md.")
    ] = None
    depth_scale: Annotated[
        float | None, typer.Option(min=1e-6, help="Depth values in a metre; found out if it can.")
    ] = None
    depth_max: Annotated[
        float | None, typer.Option(min=0.0, help="Metres beyond which depths are left out.")
    ] = None
    masks: Annotated[
        Path | None,
        typer.Option(help="Folder with a mask for each depth image, or a pattern: the object."),
    ] = None
    color: Annotated[
        Path | None,
        typer.Option(help="Folder with a colour image for each depth image; none for none."),
    ] = None

    def named(self, inputs: list[str]) -> "Sequence[Path | str] | DepthImages":
        """What a user names: files, or depth images."""
        from scanweld.io.depth import capture

        return capture.as_named(
            inputs,
            capture.DepthOptions(
                intrinsics=self.intrinsics,
                scale=self.depth_scale,
                max_depth=self.depth_max,
                masks=self.masks,
                color=self.color,
            ),
        )


@dataclass(frozen=True, kw_only=True)
class ShowOptions:
    """What is printed of a run and its result."""

    as_json: Annotated[
        bool,
        typer.Option("--json", help="Tell of progress and the verdict as JSON, a line an event."),
    ] = False
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Warnings only, no progress.")] = (
        False
    )
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="A detailed log.")] = False

    def reporting(self) -> "AbstractContextManager[Progress]":
        """Shows progress for as long as the context lasts."""
        from scanweld.app.progress import reporting

        return reporting(quiet=self.quiet, verbose=self.verbose, as_json=self.as_json)

    def tell(self, line: str) -> None:
        """Say something to whoever watches a run."""
        if not (self.quiet or self.as_json):
            typer.echo(line, err=True)

    def finish(self, result: "Reconstruction", output: Path) -> None:
        """Print the verdict, and leave with its exit code."""
        from scanweld.app.json_lines import finished_line
        from scanweld.app.summary import summary

        typer.echo((finished_line if self.as_json else summary)(result, output))
        raise typer.Exit(result.verdict.exit_code)


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be exported, from where; also options of the command.

    Attributes:
        poses: Names of formats of poses.
        model: Names of formats of meshes.
        points: Name of a PLY file of all points.
        scans: The scans, where they are no longer where the model says.
        component: Which component, from 1; only the first has a mesh.
        unit: Of the scans, where the model does not say.
        up: The model's axis that points up, for GLB.
    """

    poses: Annotated[list[PoseFormat], typer.Option(help="Poses; may be repeated.")] = field(
        default_factory=list
    )
    model: Annotated[list[MeshFormat], typer.Option(help="The mesh; may be repeated.")] = field(
        default_factory=list
    )
    points: Annotated[
        str | None, typer.Option(metavar="NAME.ply", help="All points, with their scan's number.")
    ] = None
    scans: MovedScans = field(default_factory=list)
    component: Annotated[int, typer.Option(min=1, help="Which component, if several.")] = 1
    unit: UnitOption = None
    up: Annotated[Axis, typer.Option(help="The model's axis that points up, for GLB.")] = "y"
