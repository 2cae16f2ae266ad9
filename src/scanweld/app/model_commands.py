"""Commands that make a model or start from one: ``run``, ``fuse``, ``report`` and ``export``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scanweld.app.options import (
    ConfigFile,
    DepthOptions,
    Force,
    Inputs,
    MovedScans,
    NoCacheOption,
    Output,
    ShowOptions,
    SurfaceOptions,
    UnitOption,
    Wanted,
    Workers,
    takes,
    without_collecting,
)
from scanweld.choices import Method, Shown
from scanweld.errors import ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scanweld.app.video_job import Video
    from scanweld.io.depth.capture import DepthImages
    from scanweld.knowledge.facts import Knowledge

# What the commands do is imported inside them: help then starts at once.


@dataclass(frozen=True, kw_only=True)
class FactOptions:
    """What users know beforehand."""

    knowledge: Annotated[
        Path | None, typer.Option("--knowledge", help="The five that follow, as a JSON file.")
    ] = None
    fix: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="The frame of this scan is the world. Can be repeated."),
    ] = None
    start: Annotated[
        Path | None,
        typer.Option(help="Poses to be tried besides, a poses.json; never just believed."),
    ] = None
    together: Annotated[
        list[str] | None,
        typer.Option(
            metavar="A B", help="Two scans see some of the same surface. Can be repeated."
        ),
    ] = None
    apart: Annotated[
        list[str] | None,
        typer.Option(metavar="A B", help="Two scans must not be laid together. Can be repeated."),
    ] = None
    turntable: Annotated[
        bool, typer.Option("--turntable", help="All scans turn about one, unknown axis.")
    ] = False

    def known(self) -> "Knowledge":
        """The facts of the options and of the file."""
        from scanweld.app.named_pairs import named_pairs
        from scanweld.io import read_poses
        from scanweld.knowledge.facts import Knowledge, read_knowledge

        told = Knowledge(
            fix=tuple(self.fix or ()),
            start=None if self.start is None else read_poses(self.start),
            together=named_pairs("--together", self.together),
            apart=named_pairs("--apart", self.apart),
            turntable=self.turntable,
        )
        return told if self.knowledge is None else read_knowledge(self.knowledge).joined(told)


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """What ``run`` takes."""

    inputs: Inputs
    output: Output
    config: ConfigFile = None
    workers: Workers = None
    memory: Annotated[
        str | None,
        typer.Option(metavar="SIZE", help="Most memory, as 2G or 800M; large scans are thinned."),
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A dask cluster to work on, as tcp://host:8786."),
    ] = None
    no_cache: NoCacheOption = False
    unit: UnitOption = None
    shown: Annotated[
        Shown | None,
        typer.Option(
            "--object",
            help="Of whole depth frames: auto (the default), moving things only, or all.",
        ),
    ] = None
    video: Annotated[
        bool,
        typer.Option("--video", help="The depth images are a video, in the order of their names."),
    ] = False
    min_accuracy: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="PERCENT",
            help="Doubt scans that may be off by more, in percent of the diameter.",
        ),
    ] = None
    method: Annotated[
        Method | None, typer.Option(help="robust (the default), or paper: as published.")
    ] = None
    facts: FactOptions
    with_doubtful: Annotated[
        bool, typer.Option("--with-doubtful", help="Make doubtful scans part of the model too.")
    ] = False
    surface: SurfaceOptions
    depth: DepthOptions
    force: Force = False
    show: ShowOptions

    def named(self) -> "Sequence[Path | str] | DepthImages | Video":
        """What a user names: files, depth images, or a video of such."""
        named = self.depth.named(self.inputs)
        if not self.video:
            return named
        from scanweld.app.video_job import Video
        from scanweld.io.depth.capture import DepthImages

        return Video(images=named if isinstance(named, DepthImages) else DepthImages(inputs=named))


@takes(RunOptions)
def run(options: RunOptions) -> None:
    """Register and fuse scans: poses, a model and a verdict."""
    with without_collecting():
        from scanweld.app.cache import cache_folder
        from scanweld.app.first_run import compiling_ahead
        from scanweld.app.job import Limits, run_job
        from scanweld.app.memory import parse_size
        from scanweld.config import load_config

    output, memory = options.output, options.memory
    fusion = {**options.surface.settings(), "with_doubtful": options.with_doubtful or None}
    settings = load_config(
        options.config,
        object=options.shown,
        unit=options.unit,
        method=options.method,
        fusion=fusion,
        confidence={"min_accuracy_percent": options.min_accuracy},
    )
    known = options.facts.known()
    processes = options.workers if memory is None else 1  # others would take memory too
    try:
        with (
            compiling_ahead(options.show.tell, processes, of_video=options.video) as starting,
            options.show.reporting() as progress,
        ):
            size = None if memory is None else parse_size(memory)
            limits = Limits(
                workers=options.workers,
                memory=size,
                keeps=not options.no_cache,
                scheduler=options.scheduler,
            )
            result = run_job(
                options.named(),
                output,
                settings,
                knowledge=known,
                limits=limits,
                force=options.force,
                progress=starting(progress),
            )
    except KeyboardInterrupt:
        kept = cache_folder(output)
        goes_on = kept.exists() and not options.no_cache
        remark = f"the same command goes on from {kept}" if goes_on else "nothing was written"
        typer.echo(f"scanweld: interrupted; {remark}", err=True)
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    options.show.finish(result, output)


@dataclass(frozen=True, kw_only=True)
class FuseOptions:
    """What ``fuse`` takes."""

    inputs: Inputs
    poses: Annotated[
        Path, typer.Option(help="Poses of the scans, in any format that export writes.")
    ]
    output: Output
    config: ConfigFile = None
    workers: Workers = None
    no_cache: NoCacheOption = False
    unit: UnitOption = None
    surface: SurfaceOptions
    force: Force = False
    show: ShowOptions


@takes(FuseOptions)
def fuse(options: FuseOptions) -> None:
    """Fuse scans whose poses are known; exit code 3 if some had to be left out."""
    with without_collecting():
        from scanweld.app.first_run import compiling_ahead
        from scanweld.app.fuse import fuse_job
        from scanweld.app.job import Limits
        from scanweld.config import load_config

    settings = load_config(options.config, unit=options.unit, fusion=options.surface.settings())
    with (
        compiling_ahead(options.show.tell, options.workers) as starting,
        options.show.reporting() as progress,
    ):
        result = fuse_job(
            options.inputs,
            options.poses,
            options.output,
            settings,
            limits=Limits(workers=options.workers, keeps=not options.no_cache),
            force=options.force,
            progress=starting(progress),
        )
    options.show.finish(result, options.output)


def report(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="Folder that run or fuse has made.")
    ],
    scans: MovedScans = [],  # noqa: B006
) -> None:
    """Write report.html of a finished model folder anew."""
    from scanweld.app.job import report_job

    typer.echo(report_job(model, scans))


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """What ``export`` takes."""

    model_dir: Annotated[Path, typer.Argument(help="A folder that run or fuse has made.")]
    output: Output
    wanted: Wanted
    force: Force = False


@takes(ExportOptions)
def export(options: ExportOptions) -> None:
    """Write a model, its poses and points for other tools; exit code 3 if some was left out."""
    from scanweld.app.export import export as export_model

    made = export_model(options.model_dir, options.output, options.wanted, force=options.force)
    lines = [f"{options.output}: {', '.join(made.files)}", *made.notes]
    typer.echo("\n".join([*lines, *made.left_out]))
    raise typer.Exit(ExitCode.NOT_GOOD if made.left_out else ExitCode.GOOD)
