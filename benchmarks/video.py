"""Video to keyframes: drift, noise, time and memory, and models of objects, against the truth.

    python -m benchmarks.video --out docs/data/video.json
    python -m benchmarks.video --quick

- kitchen: 50 frames of a Kinect (7-Scenes), whose given poses are good to some centimetres.
- long: the same there and back, 1,000 frames in all, for time and memory.
- noise: a simulated way through a room, with exact truth.
- objects: made objects on a table, 300 simulated frames once around each, to a model.
- room: the room of noise, 200 frames to a model, beside Open3D on the same frames.
"""

import argparse
import json
import multiprocessing
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.captures import depth_frames, kept_records, parser_of
from benchmarks.kept import warn_of_old_calibration
from benchmarks.results import Json, write_results
from benchmarks.sets import data_folder
from benchmarks.study.optional import is_usable
from benchmarks.surface.open3d_video import reconstructed
from benchmarks.surface.surface_distances import surface_distances
from benchmarks.virtual.bodies import make_body
from benchmarks.virtual.handheld import (
    KINECT,
    around,
    exact_depth,
    measured,
    pinhole,
    room,
    table_with,
    together,
)
from scanweld.app.video_job import take_video
from scanweld.config import Config
from scanweld.cut.frames import depth_image
from scanweld.cut.smoothing import trimmed_rms
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.io import PoseSet
from scanweld.io.depth.capture import DepthImages, DepthOptions, Frame
from scanweld.io.poses import read_poses
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline.run import run
from scanweld.reconstruction import Reconstruction
from scanweld.video.keyframes import keyframes
from scanweld.video.noise import depth_noise
from scanweld.video.records import Fate, Keyframe, Log, VideoFrame
from scanweld.work.progress import silent
from scanweld.work.stage_log import peak_memory_mb
from scanweld.work.threads import single_threaded_algebra

NUM_NOISE, NUM_AROUND, TURN_DEG = 60, 300, 350.0
DISTANCE, SIZE = 0.5, 0.2
"""Of the camera from the object, and its largest extent, in metres."""
NUM_ROOM, ROOM_VOXEL = 200, 3.0 / 512
"""Frames of the room, one a degree; and the voxels of Open3D's own example, in metres."""


def main() -> int:
    """Measure; print a line for each record."""
    parts = {"kitchen": kitchen, "long": long, "noise": noise, "objects": objects}
    parts["room"] = room_model
    parser = parser_of("Video of depth cameras.", "part", parts)
    add = parser.add_argument
    add("--frames", type=int, default=1000, help="of the long video")
    add("--objects", type=int, default=5, help="how many of them")
    add("--pixels", type=int, default=320, help="width of the objects' frames")
    add("--turn", type=float, default=TURN_DEG, help="how far around them, in degrees")
    options = parser.parse_args()
    warn_of_old_calibration()
    wanted = ["noise"] if options.quick else options.parts
    records = kept_records(options.out, "part", wanted)
    for part in wanted:
        for record in parts[part](options):
            records.append({"part": part, **record})
            print(json.dumps(records[-1]), flush=True)
            if options.out:
                write_results(options.out, records)
    return 0


def by_part(records: Sequence[Json]) -> Json:
    """The records of each part."""
    parts = ("kitchen", "long", "noise", "objects", "room")
    return {part: [record for record in records if record["part"] == part] for part in parts}


def kitchen(options: argparse.Namespace) -> Iterator[Json]:
    """Drift against the given poses, and noise by second differences, of real frames."""
    folder = data_folder(options.data) / "depth" / "video-kinect-kitchen"
    truth = read_poses(folder / "poses.json").poses
    frames = depth_frames(folder)
    depth = {frame.name: depth_image(frame.read()) for frame in frames}
    found, log, seconds = _tracked(
        [VideoFrame(name=name, depth=image) for name, image in depth.items()], _camera(frames)
    )
    names = [frame.name for frame in frames]
    steps = [truth[a].inverse() @ truth[b] for a, b in pairwise(names)]
    way = sum(float(np.linalg.norm(step.translation)) for step in steps)
    for each in found:
        off = _off(each, found[0], truth)
        before, after = _roughness(depth[each.name]), _roughness(each.depth)
        yield {
            "keyframe": each.name,
            "frames": each.num_frames,
            "piece": each.piece,
            "off_mm": 1e3 * float(np.linalg.norm(off.translation)),
            "off_deg": off.angle_deg(),
            "way_mm": 1e3 * way,
            "noise_mm_z2": [1e3 * before, 1e3 * after],
            "lower_by": before / after,
            "without_return": [float(np.isnan(d).mean()) for d in (depth[each.name], each.depth)],
            "cpu_seconds": seconds,
            "fates": _fates(log),
        }


def long(options: argparse.Namespace) -> Iterator[Json]:
    """CPU time and peak memory of a long video, in a process of its own, from files to files."""
    folder = data_folder(options.data) / "depth" / "video-kinect-kitchen"
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        yield pool.apply(_long, (folder, options.frames))


def _long(folder: Path, num_frames: int) -> Json:
    names = sorted(path.name for path in (folder / "depth").iterdir())
    there_and_back = [*names, *names[-2:0:-1]]
    with TemporaryDirectory() as name:
        frames, model = Path(name) / "depth", Path(name) / "model"
        frames.mkdir()
        model.mkdir()
        for k in range(num_frames):
            source = folder / "depth" / there_and_back[k % len(there_and_back)]
            (frames / f"frame-{k:06d}.png").symlink_to(source)
        options = DepthOptions(intrinsics=folder / "intrinsics.json")
        files = DepthImages(inputs=[frames], options=options).collect()
        cpu, wall = time.process_time(), time.perf_counter()
        taken = take_video(files, model, 1, silent)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    return {
        "frames": len(files),
        "keyframes": len(taken.files),
        "pieces": len(taken.start.components),
        "cpu_seconds": cpu,
        "wall_seconds": wall,
        "peak_mb": peak_memory_mb(),
    }


def noise(options: argparse.Namespace) -> Iterator[Json]:
    """Pose and depth of keyframes of a simulated way around a table in a room."""
    rng = np.random.default_rng(0)
    scene = together([room(rng), table_with(make_body("thing", 0).mesh, 0.3)])
    count, camera = (12, pinhole(160)) if options.quick else (NUM_NOISE, pinhole(640))
    poses = around(np.array([0.0, 0.0, 0.85]), 1.0, np.linspace(0, 60.0, count), rng)
    truth = {f"{k:04d}": pose for k, pose in enumerate(poses)}
    found, log, seconds = _tracked(list(_simulated(scene, truth, camera)), camera)
    for each in found:
        exact = exact_depth(scene, truth[each.name], camera)
        one = measured(exact, KINECT, np.random.default_rng(len(truth))) - exact
        mean = each.depth - exact
        both = np.isfinite(one) & np.isfinite(mean)
        square, counts = exact[both] ** 2, np.sqrt(each.count[both])
        off = _off(each, found[0], truth)
        yield {
            "keyframe": each.name,
            "frames": each.num_frames,
            "off_mm": 1e3 * float(np.linalg.norm(off.translation)),
            "off_deg": off.angle_deg(),
            "noise_mm_z2": [1e3 * _most(one[both] / square), 1e3 * _most(mean[both] / square)],
            "over_root_n": _most(mean[both] * counts / square) / _most(one[both] / square),
            "far_off": float((np.abs(mean[both]) > 0.03 * exact[both]).mean()),
            "without_return": [float(np.isnan(image).mean()) for image in (one, mean)],
            "cpu_seconds": seconds,
            "fates": _fates(log),
        }


def objects(options: argparse.Namespace) -> Iterator[Json]:
    """Models of objects, from frames in which all but the object is farther than its table."""
    for seed in range(options.objects):
        yield _object(("thing", "other thing")[seed % 2], seed // 2, options)


def _object(kind: str, seed: int, options: argparse.Namespace) -> Json:
    rng, camera = np.random.default_rng([seed, 7]), pinhole(options.pixels)
    body = table_with(make_body(kind, seed).mesh, SIZE, 0.0)
    middle = np.array([0.0, 0.0, 0.4 * SIZE])
    count = round(NUM_AROUND * options.turn / TURN_DEG)
    poses = around(middle, DISTANCE, np.linspace(0.0, options.turn, count), rng)
    truth = {f"{k:04d}": pose for k, pose in enumerate(poses)}
    found, log, seconds = _tracked(_simulated(body, truth, camera), camera)
    began = time.process_time()
    result = _registered(found, log, camera, options.workers, Config())
    mesh = result.mesh or result.preview
    record: Json = {
        "object": f"{kind} {seed}",
        "frames": count,
        "pixels": options.pixels,
        "turn_deg": options.turn,
        "keyframes": len(found),
        "placed": len(result.poses),
        "components": len(result.components),
        "verdict": result.verdict.value,
        "is_preview": result.mesh is None,
        "track_off_mm": 1e3 * max(_shift(each, found[0], truth) for each in found),
        "video_cpu_seconds": seconds,
        "cpu_seconds": time.process_time() - began,
        "fates": _fates(log),
    }
    if mesh is None:
        return record
    placed = _placed(mesh, result, truth)
    near = (placed[:, 2] > 0.01) & (np.abs(placed[:, :2]) < SIZE).all(axis=1)
    off = surface_distances(placed[near], body)
    middle_mm, most_mm = 1e3 * np.quantile(off, [0.5, 0.95])
    return {**record, "median_mm": float(middle_mm), "most_mm": float(most_mm)}


def room_model(options: argparse.Namespace) -> Iterator[Json]:
    """A way around a table in a room, to a model, beside Open3D on the very same frames."""
    rng, camera = np.random.default_rng(0), pinhole(options.pixels)
    scene = together([room(rng), table_with(make_body("thing", 0).mesh, 0.3)])
    turns = np.linspace(0.0, NUM_ROOM * 1.0, NUM_ROOM)
    poses = around(np.array([0.0, 0.0, 0.85]), 1.0, turns, rng)
    truth = {f"{k:04d}": pose for k, pose in enumerate(poses)}
    frames = list(_simulated(scene, truth, camera))
    began = time.process_time()
    found, log, _ = _tracked(frames, camera)
    result = _registered(found, log, camera, options.workers, Config(object="all"))
    mesh, seconds = result.mesh or result.preview, time.process_time() - began
    common: Json = {"frames": len(frames), "pixels": options.pixels}
    if mesh is not None:
        ours = _placed(mesh, result, truth)
        told = {"keyframes": len(found), "placed": len(result.poses)}
        told |= {"components": len(result.components), "verdict": result.verdict.value}
        yield {**common, "by": "scanweld", **_apart(ours, scene), "cpu_seconds": seconds, **told}
    if is_usable("open3d"):
        began = time.process_time()
        mesh, _ = reconstructed([frame.depth for frame in frames], camera, ROOM_VOXEL)
        seconds, theirs = time.process_time() - began, poses[0].apply(mesh.vertices)
        yield {**common, "by": "Open3D", **_apart(theirs, scene), "cpu_seconds": seconds}


def _apart(points: FloatArray, scene: TriangleMesh) -> Json:
    off = 1e3 * surface_distances(points, scene, num_samples=1_000_000)
    return dict(zip(("median_mm", "most_mm"), np.quantile(off, [0.5, 0.95]).tolist(), strict=True))


def _registered(
    found: Sequence[Keyframe], log: Log, camera: Camera, workers: int, config: Config
) -> Reconstruction:
    """Keyframes as scans, run as ``scanweld run --video`` does."""
    pieces = [
        tuple(each.name for each in found if each.piece == k) for k in range(len(log.breaks) + 1)
    ]
    starts = {each.name: each.piece_from_keyframe for each in found}
    start = PoseSet(poses=starts, components=tuple(pieces))
    scans = [_scan(each, camera) for each in found]
    return run(scans, config, knowledge=Knowledge(start=start), workers=workers)


def _placed(mesh: TriangleMesh, result: Reconstruction, truth: dict[str, Pose]) -> FloatArray:
    """The vertices of a model where the pose of its first scan is the true one."""
    reference = result.components[0][0]
    return truth[reference].apply(result.poses[reference].inverse().apply(mesh.vertices))


def _simulated(scene: TriangleMesh, truth: dict[str, Pose], camera: Camera) -> Iterator[VideoFrame]:
    for k, (name, pose) in enumerate(truth.items()):
        exact = exact_depth(scene, pose, camera)
        yield VideoFrame(name=name, depth=measured(exact, KINECT, np.random.default_rng(k)))


def _tracked(
    frames: Iterator[VideoFrame] | Sequence[VideoFrame], camera: Camera
) -> tuple[list[Keyframe], Log, float]:
    """Keyframes, what became of the frames, and CPU seconds, those of making frames too."""
    began, log, kept = time.process_time(), Log(), list(frames)
    with single_threaded_algebra():
        sigma = depth_noise([frame.depth for frame in kept[:: -(-len(kept) // 5)]])
        found = list(keyframes(kept, camera, sigma, log))
    return found, log, time.process_time() - began


def _scan(keyframe: Keyframe, camera: Camera) -> RangeScan:
    has = np.isfinite(keyframe.depth)
    grid = np.full(has.shape, -1)
    grid[has] = np.arange(has.sum())
    return RangeScan(
        name=keyframe.name,
        points=camera.unproject_image(keyframe.depth)[has],
        grid=grid,
        camera=camera,
        scan_from_sensor=Pose.identity(),
        viewpoint=Viewpoint.GIVEN,
    )


def _camera(frames: Sequence[Frame]) -> Camera:
    camera = frames[0].read().camera
    assert camera is not None
    return camera


def _off(keyframe: Keyframe, first: Keyframe, truth: dict[str, Pose]) -> Pose:
    """What a keyframe's pose before the first is off."""
    true = truth[first.name].inverse() @ truth[keyframe.name]
    return true.inverse() @ first.piece_from_keyframe.inverse() @ keyframe.piece_from_keyframe


def _shift(keyframe: Keyframe, first: Keyframe, truth: dict[str, Pose]) -> float:
    return float(np.linalg.norm(_off(keyframe, first, truth).translation))


def _roughness(depth: FloatArray) -> float:
    """Noise of single pixels over the depth's square, by second differences along the rows."""
    middle = depth[:, 1:-1]
    off = (middle - 0.5 * (depth[:, :-2] + depth[:, 2:])) / np.sqrt(1.5) / middle**2
    return trimmed_rms(off[np.isfinite(off)])


def _most(values: FloatArray) -> float:
    """Root mean square of all but the farthest percent: at edges pixels see what is beside."""
    size = np.abs(values)
    return float(np.sqrt(np.mean(size[size <= np.quantile(size, 0.99)] ** 2)))


def _fates(log: Log) -> Json:
    return {fate.value: len(log.named(fate)) for fate in Fate}


if __name__ == "__main__":
    sys.exit(main())
