"""The main job, files to an output folder; and its report written anew."""

import logging
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from scanweld.app.cache import FileCache, cache_folder
from scanweld.app.frame_files import write_frames
from scanweld.app.html_report import write_html_report
from scanweld.app.memory import MEGABYTE, points_within, workers_within
from scanweld.app.model_folder import open_model
from scanweld.app.outputs import Place, write_outputs
from scanweld.app.video_job import Video, placed, take_video
from scanweld.app.workspace import Workspace
from scanweld.config import Config
from scanweld.errors import InputError, ReadError
from scanweld.geometry.scan import RangeScan
from scanweld.io import ScanFile, path_from, printable
from scanweld.io.depth.capture import DepthImages, collect_named, start_poses
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline import run as pipeline
from scanweld.preparation.thinning import thinned
from scanweld.reconstruction import Reconstruction
from scanweld.work.progress import Progress, ScanRefused, StageAdvanced, silent, telling
from scanweld.work.runners import Runner
from scanweld.work.stage_log import peak_memory_mb
from scanweld.work.threads import num_workers

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, slots=True)
class Limits:
    """What a run may take of the machine, and of others.

    Attributes:
        workers: Threads; as many as there are cores if None.
        memory: Bytes: large scans are thinned for it, and fewer are prepared at a time if need be.
            Any if None.
        keeps: Whether finished work is kept beside the output, for later runs, and found there.
        scheduler: Address of a cluster that works over scans and pairs; None for threads alone.
    """

    workers: int | None = None
    memory: int | None = None
    keeps: bool = True
    scheduler: str | None = None


NO_LIMITS = Limits()


def run_job(
    inputs: Sequence[Path | str] | DepthImages | Video,
    output: Path | str,
    config: Config | None = None,
    *,
    knowledge: Knowledge | None = None,
    limits: Limits = NO_LIMITS,
    force: bool = False,
    progress: Progress = silent,
) -> Reconstruction:
    """Read scans, register and fuse them, and write what was found out: ``scanweld run``.

    Args:
        inputs: Files, folders and glob patterns; or depth images with what is known of them, which
            may be the frames of a video.
        output: The folder to be made; it appears when it is whole.
        config: Settings; the defaults if not given.
        knowledge: What is known of the scans beforehand.
        limits: What the run may take of the machine, and of others.
        force: Whether an output that is there already is replaced.
        progress: Told of stages, their finished items, and scans that are refused.

    Raises:
        ScanweldError: If there is too little to work on, the output cannot be written, or there is
            no such cluster. Files that cannot be read are named in the result instead.
    """
    config, known = config or Config(), knowledge or Knowledge()
    video, workers, memory = None, limits.workers, limits.memory
    frames = inputs.collect() if isinstance(inputs, Video) else None
    files: Sequence[ScanFile] = frames or ()
    if not isinstance(inputs, Video):
        files = collect_named(inputs)
        known = _with_layout_poses(known, files)
    paths = [file.path for file in files]
    cache = FileCache(cache_folder(Path(output))) if limits.keeps else None
    with (
        Workspace(Path(output), inputs=paths, force=force) as workspace,
        _runner(limits.scheduler) as runner,
    ):
        if frames is not None:
            video = take_video(frames, workspace.staging, num_workers(workers), progress)
            files, paths = video.files, [file.path for file in video.files]
            known = Knowledge(start=video.start).joined(known)
        max_points = None if memory is None else points_within(memory, paths)
        scans, unreadable = read_all(files, progress, max_points)
        if video is not None:
            unreadable.update(video.unreadable)
        if memory is not None:
            num_points = [len(scan.points) for scan in scans]
            workers = workers_within(memory, num_points, num_workers(workers))
        result = pipeline.run(
            scans,
            config,
            knowledge=known,
            unreadable=unreadable,
            workers=runner or workers,
            cache=cache,
            progress=progress,
        )
        if video is not None:
            result = video.told(result)
        places = relative_places(
            placed(files, workspace.staging, workspace.output), workspace.output
        )
        write_outputs(result, workspace.staging, places, max_points)
        write_frames(files, workspace.staging, workspace.output)
        with telling(progress, "report"):
            shown = {scan.name: scan for scan in scans}
            write_html_report(workspace.staging, shown, result, num_workers(workers))
        workspace.publish()
    if memory is not None and peak_memory_mb() > memory / MEGABYTE:
        logger.warning("the run took %.0f MB, more than it was to take", peak_memory_mb())
    return result


def _with_layout_poses(known: Knowledge, files: Sequence[ScanFile]) -> Knowledge:
    """What is known, with the poses that a capture has as starts if no others are given."""
    return known if known.start is not None else replace(known, start=start_poses(files))


def _runner(scheduler: str | None) -> AbstractContextManager[Runner | None]:
    if scheduler is None:
        return nullcontext()
    from scanweld.work.cluster import Cluster  # only who has a cluster has what it takes

    return Cluster(scheduler)


def relative_places(files: Sequence[ScanFile], folder: Path) -> dict[str, Place]:
    """Where each scan is, by the scan's name: its file as seen from a folder, and its part."""
    return {
        file.name: Place(file=printable(path_from(folder, file.path)), part=file.part)
        for file in files
    }


def read_all(
    files: Sequence[ScanFile], progress: Progress = silent, max_points: int | None = None
) -> tuple[list[RangeScan], dict[str, str]]:
    """Scans of all files that can be read, thinned if need be; of the others, name -> reason."""
    scans: list[RangeScan] = []
    unreadable: dict[str, str] = {}
    with telling(progress, "read") as counts:
        for done, file in enumerate(files, start=1):
            try:
                scan = file.read()
                scans.append(scan if max_points is None else thinned(scan, max_points))
            except ReadError as error:
                unreadable[file.name] = printable(str(error))
                progress(ScanRefused(scan=file.name, reason=unreadable[file.name]))
            progress(StageAdvanced(stage="read", done=done, total=len(files)))
        counts["scans"] = len(scans)
    return scans, unreadable


def report_job(folder: Path | str, inputs: Sequence[Path | str] = ()) -> Path:
    """Write report.html of a finished model folder anew: ``scanweld report``.

    Args:
        folder: What ``scanweld run`` or ``fuse`` made.
        inputs: The scans it was made of, where they are no longer where the report says. Where
            they are not found at all, the page goes without what only they can tell.

    Returns:
        Path of the page.

    Raises:
        ScanweldError: If the folder is not whole, or the scans are not those of the run.
    """
    model = open_model(Path(folder))
    try:
        cut = [name for name, scan in model.report.scans.items() if scan.kept is not None]
        files = model.scan_files(dict.fromkeys([*model.poses.poses, *cut]), inputs)
    except InputError as error:
        if inputs:
            raise
        logger.warning("%s; without them there are no residuals, support and contours", error)
        return write_html_report(model.path)
    return write_html_report(model.path, model.read_scans(files))
