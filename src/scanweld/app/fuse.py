"""Scans whose poses are known already, to a model: ``scanweld fuse``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scanweld.app.job import read_all, relative_paths
from scanweld.app.json_text import json_text
from scanweld.app.outputs import FORMAT, stage_json
from scanweld.app.workspace import Workspace
from scanweld.config import Config
from scanweld.fusion import fuse
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.intake import Intake, take_in
from scanweld.io import PoseSet, collect, natural_key, write_mesh_ply, write_poses, write_whole
from scanweld.io.pose_formats import Frame, PoseEntries, match_poses, read_any_poses
from scanweld.io.pose_formats.records import require_pinhole
from scanweld.knowledge import Knowledge
from scanweld.parallel import num_workers, single_threaded_algebra
from scanweld.progress import NoCache, Progress, silent
from scanweld.stages import Stages


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Fused:
    """What became of the scans.

    Attributes:
        mesh: In the world frame of the poses.
        poses: world_from_scan of the scans in it.
        left_out: Reason for each of the others, by name.
    """

    mesh: TriangleMesh
    poses: Mapping[str, Pose]
    left_out: Mapping[str, str]


def fuse_job(
    inputs: Sequence[Path | str],
    poses: Path,
    output: Path,
    config: Config | None = None,
    *,
    workers: int | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> Fused:
    """Read scans and poses, fuse them, and write a model's folder without graph.

    Args:
        inputs: Files, folders and glob patterns.
        poses: A file of poses in any format that scanweld knows, or a folder of them.
        output: The folder to be made; it appears when it is whole.
        config: Settings; the defaults if not given.
        workers: Threads; as many as there are cores if not given.
        force: Whether an output that is there already is replaced.
        progress: Called with (stage, done, total).

    Raises:
        ScanweldError: If the poses cannot be read or are of other scans, there are fewer than two
            usable scans, or the output cannot be written.
    """
    config = config or Config()
    files = collect(inputs)
    found = read_any_poses(poses)
    known = match_poses(poses, found, [file.name for file in files])
    parts = [*(poses.iterdir() if poses.is_dir() else [poses]), *(file.path for file in files)]
    with Workspace(output, inputs=parts, force=force) as workspace:
        scans, unreadable = read_all([file for file in files if file.name in known], progress)
        stages = Stages(workers=num_workers(workers), cache=NoCache(), progress=progress)
        with single_threaded_algebra():
            intake = take_in(scans, unreadable, Knowledge(), config, stages)
            fused = _fuse(intake, known, found, config, stages)
        without = {
            file.name: f"no pose in {poses.name}" for file in files if file.name not in known
        }
        left_out = {**fused.left_out, **without}
        fused = Fused(mesh=fused.mesh, poses=fused.poses, left_out=left_out)
        _write(fused, relative_paths(files, workspace.output), config, stages, workspace.staging)
        workspace.publish()
    return fused


def _fuse(
    intake: Intake, known: Mapping[str, Pose], found: PoseEntries, config: Config, stages: Stages
) -> Fused:
    world_from_sensor = [_sensor_pose(scan, known[scan.name], found) for scan in intake.prepared]
    with stages.stage("fuse") as counts:
        mesh = fuse(
            intake.prepared,
            world_from_sensor,
            config.fusion,
            prepare=config.prepare,
            workers=stages.workers,
        )
        counts["faces"] = len(mesh.faces)
    pairs = zip(intake.prepared, world_from_sensor, strict=True)
    poses = {scan.name: pose @ scan.scan_from_sensor.inverse() for scan, pose in pairs}
    if found.frame is Frame.SCAN:
        poses = {name: known[name] for name in poses}  # as given, to the last bit
    return Fused(mesh=mesh, poses=poses, left_out=intake.refused)


def _sensor_pose(scan: PreparedScan, pose: Pose, found: PoseEntries) -> Pose:
    """world_from_sensor, from a pose in the frame that the file speaks of."""
    if found.frame is Frame.SCAN:
        return pose @ scan.scan_from_sensor
    require_pinhole(scan.name, scan.scan.camera, found.title)
    return pose


def _write(
    fused: Fused, files: Mapping[str, str], config: Config, stages: Stages, folder: Path
) -> None:
    names = sorted(fused.poses, key=natural_key)
    pose_set = PoseSet(
        poses=dict(fused.poses), components=(tuple(names),), unplaced=dict(fused.left_out)
    )
    report = {
        "format": FORMAT,
        "scans": {name: {"file": files[name]} for name in sorted(files, key=natural_key)},
        "stages": {name: stage_json(stage) for name, stage in stages.reports.items()},
        "settings": config.model_dump(mode="json"),
    }
    write_mesh_ply(folder / "model.ply", fused.mesh)
    write_poses(folder / "poses.json", pose_set)
    write_whole(folder / "report.json", json_text(report).encode())
    write_whole(folder / "config.toml", config.to_toml().encode())
