"""Scans whose poses are known already, to a model: ``scanweld fuse``."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from scanweld.app.cache import FileCache, cache_folder
from scanweld.app.frame_files import write_frames
from scanweld.app.html_report import write_html_report
from scanweld.app.job import NO_LIMITS, Limits, read_all, relative_places
from scanweld.app.outputs import write_outputs
from scanweld.app.workspace import Workspace
from scanweld.config import Config
from scanweld.errors import InputError
from scanweld.fusion import fuse
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.io import natural_key, printable
from scanweld.io.depth.capture import DepthOptions, as_named, collect_named
from scanweld.io.pose_formats import Frame, PoseEntries, match_all_poses, read_any_poses
from scanweld.io.pose_formats.records import require_pinhole
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline.conclude import prepared_report, unplaced_report
from scanweld.pipeline.intake import Intake, require_two, take_in
from scanweld.reconstruction import Reconstruction, ScanVerdict, Verdict
from scanweld.work.progress import NoCache, Progress, ScanRefused, silent, telling
from scanweld.work.stage_log import Stages
from scanweld.work.threads import num_workers, single_threaded_algebra


def fuse_job(
    inputs: Sequence[Path | str],
    poses: Path,
    output: Path,
    config: Config | None = None,
    *,
    limits: Limits = NO_LIMITS,
    force: bool = False,
    progress: Progress = silent,
) -> Reconstruction:
    """Read scans and poses, fuse them, and write a model's folder, whose graph has no pairs.

    Args:
        inputs: Files, folders and glob patterns.
        poses: A file of poses in any format that scanweld knows, or a folder of them.
        output: The folder to be made; it appears when it is whole.
        config: Settings; the defaults if not given.
        limits: Its workers and whether it keeps finished work; nothing else of them is used.
        force: Whether an output that is there already is replaced.
        progress: Told of stages, their finished items, and scans that are refused.

    Returns:
        The model and the poses in the world frame that was given; these are not judged. A scan
        without a sound pose, or of which the file's poses cannot speak, is left out and named.

    Raises:
        ScanweldError: If the poses cannot be read or are of other scans, there are fewer than two
            usable scans, or the output cannot be written.
    """
    config = config or Config()
    files = collect_named(as_named(inputs, DepthOptions()))
    found = read_any_poses(poses)
    known, broken = match_all_poses(poses, found, [file.name for file in files])
    parts = [*(poses.iterdir() if poses.is_dir() else [poses]), *(file.path for file in files)]
    with Workspace(output, inputs=parts, force=force) as workspace:
        scans, unreadable = read_all([file for file in files if file.name in known], progress)
        cache = FileCache(cache_folder(output)) if limits.keeps else NoCache()
        stages = Stages(workers=num_workers(limits.workers), cache=cache, progress=progress)
        without = {
            file.name: printable(str(broken.get(file.name, f"no pose in {poses.name}")))
            for file in files
            if file.name not in known
        }
        for name, reason in without.items():
            progress(ScanRefused(scan=name, reason=reason))
        with single_threaded_algebra():
            intake = take_in(scans, unreadable, Knowledge(), config, stages)
            result = _fuse(intake, known, found, without, config, stages)
        write_outputs(result, workspace.staging, relative_places(files, workspace.output))
        write_frames(files, workspace.staging, workspace.output)
        with telling(progress, "report"):
            write_html_report(workspace.staging, {scan.name: scan for scan in scans}, result)
        workspace.publish()
    return result


def _fuse(
    intake: Intake,
    known: Mapping[str, Pose],
    found: PoseEntries,
    without: Mapping[str, str],
    config: Config,
    stages: Stages,
) -> Reconstruction:
    """Fuse the scans that can be, and report the others, some of which are without a pose."""
    left_out = {**intake.refused, **without}
    prepared: list[PreparedScan] = []
    world_from_sensor: list[Pose] = []
    for scan in intake.prepared:
        try:
            world_from_sensor.append(_sensor_pose(scan, known[scan.name], found))
            prepared.append(scan)
        except InputError as error:
            left_out[scan.name] = str(error)
            stages.progress(ScanRefused(scan=scan.name, reason=str(error)))
    require_two(prepared, left_out)
    with stages.stage("fuse") as counts:
        mesh = fuse(
            prepared,
            world_from_sensor,
            config.fusion,
            prepare=config.prepare,
            workers=stages.workers,
            cache=stages.cache,
        )
        counts["faces"] = len(mesh.faces)
    pairs = zip(prepared, world_from_sensor, strict=True)
    poses = {scan.name: pose @ scan.scan_from_sensor.inverse() for scan, pose in pairs}
    if found.frame is Frame.SCAN:
        poses = {name: known[name] for name in poses}  # as given, to the last bit
    told = "fused with the pose that was given, which is not judged"
    return Reconstruction(
        poses=poses,
        components=(tuple(sorted(poses, key=natural_key)),),
        unplaced=left_out,
        scans={
            **{s.name: prepared_report(s, ScanVerdict.GIVEN, told) for s in prepared},
            **{n: unplaced_report(intake.scans.get(n), why) for n, why in left_out.items()},
        },
        pairs=(),
        mesh=mesh,
        verdict=Verdict.PARTIAL if left_out else Verdict.GIVEN,
        reasons=_reasons(left_out),
        stages=stages.reports,
        config=config,
        prepared={scan.name: scan for scan in prepared},
    )


def _reasons(left_out: Mapping[str, str]) -> tuple[str, ...]:
    names = ", ".join(sorted(left_out, key=natural_key))
    return (f"left out: {names}",) if left_out else ()


def _sensor_pose(scan: PreparedScan, pose: Pose, found: PoseEntries) -> Pose:
    """world_from_sensor, from a pose in the frame that the file speaks of."""
    if found.frame is Frame.SCAN:
        return pose @ scan.scan_from_sensor
    require_pinhole(scan.name, scan.scan.camera, found.title)
    return pose
