"""How good the fused model is, as Markdown tables; Open3D's fusion beside ours.

    python benchmarks/model.py --out docs/data/model.json

- virtual: a mesh scanned from 12 sides with noise, fused with the poses that were found and with
  the true ones, held against the mesh.
- real: the Stanford bunny, with the poses that were found, held against Stanford's reconstruction.
- rivals: both, against Open3D's TSDF and Poisson from the same poses and voxels.
- many: 60 virtual scans with given poses, in a process of its own.

Every model is laid onto the reference by one rigid ICP. Accuracy is the distance of the model from
the reference, completeness the share of the reference, where it was seen, within a resolution.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.surface.surface_defects import surface_defects
from benchmarks.surface.surface_fit import fit_surface
from model_tables import fidelity_table, many_table, rivals_table
from results import write_results
from rivals import Shape, poisson, shape_of, tsdf
from run import timed
from scanweld.config import Config, FusionConfig
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.simulate import simulate
from scanweld.evaluation.surface_errors import sample_surface, surface_distances
from scanweld.fusion import fuse, voxel_edge
from scanweld.geometry.arrays import BoolArray, FloatArray
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_mesh, read_poses, read_scan
from scanweld.pipeline.run import run as reconstruct
from scanweld.preparation import prepare
from scanweld.work.stage_log import peak_memory_mb
from scanweld.work.threads import map_in_order, single_threaded_algebra
from sets import BUNNY, data_folder

KINDS = ("virtual", "real", "many")
NUM_VIEWS = 12
FOOTPRINT = 0.0045
"""Of a pixel on the virtual object, in its diameters."""
NOISE = 0.001
"""Of depth, likewise."""
NUM_SAMPLES = 100_000
COMMON_RESOLUTIONS = 2.0
"""Where every surface has something within this, they are compared."""
MANY, MANY_PIXELS = 60, 1480.0
"""Scans, and pixels across the object: 300 000 points each, and some more."""
Record = dict[str, Any]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Subject:
    """Scans with poses, and the surface that they show.

    Attributes:
        name: In the tables.
        scans: Prepared.
        poses: world_from_sensor of each.
        reference: The surface, in about the same frame.
        seen: (N, 3) points spread over the part of it that was seen.
        resolution: Of the scans.
    """

    name: str
    scans: Sequence[PreparedScan]
    poses: Sequence[Pose]
    reference: TriangleMesh
    seen: FloatArray
    resolution: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Laid:
    """A model laid onto the reference, and both distances."""

    accuracy: FloatArray
    from_seen: FloatArray


def main() -> int:
    """Measure; print the tables."""
    options = _options()
    records: list[Record] = []
    for kind in options.kinds:
        with single_threaded_algebra():
            records += {"virtual": virtual, "real": real, "many": many}[kind](options)
        if options.out:
            write_results(options.out, records)
    for rows in (fidelity_table, rivals_table, many_table):
        print("\n".join(rows(records)), "\n")
    return 0


def virtual(options: argparse.Namespace) -> list[Record]:
    """The armadillo, scanned by a virtual scanner."""
    mesh = read_mesh(data_folder(options.data) / "meshes/armadillo.ply")
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder = Path(temporary) / "scans"
        noise = NoiseModel(depth_diameters=NOISE)
        truth = simulate(mesh, folder, num_scans=NUM_VIEWS, pixels=1 / FOOTPRINT, noise=noise).poses
        scans = [read_scan(path) for path in sorted(folder.glob("*.ply"))]
    prepared = [prepare(scan, Config().prepare) for scan in scans]
    resolution = FOOTPRINT * float(np.median([scan.diameter for scan in prepared]))
    right = Subject(
        name="armadillo, true poses",
        scans=prepared,
        poses=[truth[scan.name] @ scan.scan_from_sensor for scan in prepared],
        reference=mesh,
        seen=_seen(mesh, scans, truth, resolution),
        resolution=resolution,
    )
    found = replace(right, name="armadillo", poses=_found(scans, prepared, truth, options.workers))
    return [
        *compared(found, options.workers),
        _fidelity(right, _ours(right, options.workers), "virtual"),
    ]


def real(options: argparse.Namespace) -> list[Record]:
    """The bunny's ten scans."""
    folder = data_folder(options.data) / "stanford-bunny"
    scans = [read_scan(folder / f"{name}.ply") for name in BUNNY]
    reference = read_mesh(folder / "bun_zipper.ply")
    prepared = [prepare(scan, Config().prepare) for scan in scans]
    truth = read_poses(folder / "poses.json").poses
    rng = np.random.default_rng(0)
    return compared(
        Subject(
            name="bunny",
            scans=prepared,
            poses=_found(scans, prepared, truth, options.workers),
            reference=reference,
            seen=sample_surface(reference, NUM_SAMPLES, rng)[0],
            resolution=float(np.median([scan.resolution for scan in prepared])),
        ),
        options.workers,
    )


def many(options: argparse.Namespace) -> list[Record]:
    """Sixty scans, from files to a mesh, in a process of its own."""
    mesh = data_folder(options.data) / "meshes/armadillo.ply"
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder, out = Path(temporary) / "scans", Path(temporary) / "told.txt"
        simulate(read_mesh(mesh), folder, num_scans=MANY, pixels=MANY_PIXELS)
        command = [sys.executable, __file__, "--fuse", str(folder), str(out)]
        usage = timed([*command, "--workers", str(options.workers)], dict(os.environ))
        told = dict(line.split() for line in out.read_text().splitlines())
    return [{"kind": "many", **{key: float(value) for key, value in told.items()}, **usage}]


def fuse_folder(folder: Path, out: Path, workers: int) -> None:
    """Fuse scans by their true poses; write what it cost."""
    truth = read_poses(folder / "truth/poses.json").poses
    paths = sorted(folder.glob("*.ply"))
    scans = list(map_in_order(lambda p: prepare(read_scan(p), Config().prepare), paths, workers))
    poses = [truth[scan.name] @ scan.scan_from_sensor for scan in scans]
    start, cpu = time.perf_counter(), time.process_time()
    mesh = fuse(scans, poses, FusionConfig(), workers=workers)
    told = {
        "fusion_seconds": time.perf_counter() - start,
        "fusion_cpu_seconds": time.process_time() - cpu,
        "fusion_peak_mb": peak_memory_mb(),
        "scans": len(scans),
        "points": float(np.mean([len(scan.scan.points) for scan in scans])),
        "faces": len(mesh.faces),
    }
    out.write_text("".join(f"{key} {value}\n" for key, value in told.items()))


def compared(subject: Subject, workers: int) -> list[Record]:
    """Our model, its rivals and the scans themselves, from the same poses."""
    start = time.perf_counter()
    ours = _ours(subject, workers)
    models = {"scanweld": (ours, time.perf_counter() - start)}
    posed = zip(subject.scans, subject.poses, strict=True)
    shapes = [shape_of(scan, pose) for scan, pose in posed]
    voxel = _voxel(subject)
    rivals: Mapping[str, Callable[[Sequence[Shape], float], TriangleMesh]]
    rivals = {"Open3D TSDF": tsdf, "Open3D Poisson": poisson}
    for name, make in rivals.items():
        start = time.perf_counter()
        models[name] = make(shapes, voxel), time.perf_counter() - start
    laid = {name: _laid(subject, mesh) for name, (mesh, _) in models.items()}
    models["single scans"] = _together(shapes), 0.0
    laid["single scans"] = _single(subject, shapes)
    reach = COMMON_RESOLUTIONS * subject.resolution
    common = np.all([each.from_seen <= reach for each in laid.values()], axis=0)
    kind = "real" if subject.name == "bunny" else "virtual"
    records = [_fidelity(subject, ours, kind)]
    for name, (mesh, seconds) in models.items():
        precision = float(np.mean(laid[name].accuracy <= subject.resolution))
        recall = float(np.mean(laid[name].from_seen <= subject.resolution))
        records.append(
            {
                "kind": "rivals",
                "subject": subject.name,
                "model": name,
                "faces": len(mesh.faces),
                "precision": precision,
                "recall": recall,
                "f_score": 2 * precision * recall / (precision + recall),
                "common": float(common.mean()),
                "common_median": float(np.median(laid[name].from_seen[common]))
                / subject.resolution,
                "common_90": float(np.percentile(laid[name].from_seen[common], 90))
                / subject.resolution,
                **asdict(surface_defects(mesh, voxel)),
                "seconds": seconds,
            }
        )
    return records


def _fidelity(subject: Subject, mesh: TriangleMesh, kind: str) -> Record:
    laid = _laid(subject, mesh)
    unit = 1e-3 if kind == "real" else subject.resolution
    median, most = np.percentile(laid.accuracy, [50, 90]) / unit
    return {
        "kind": kind,
        "subject": subject.name,
        "accuracy_median": float(median),
        "accuracy_90": float(most),
        "completeness": float(np.mean(laid.from_seen <= subject.resolution)),
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        **asdict(surface_defects(mesh, _voxel(subject))),
        "stdev": float(np.nanmedian(mesh.stdev)) / unit if mesh.stdev is not None else None,
    }


def _ours(subject: Subject, workers: int) -> TriangleMesh:
    return fuse(subject.scans, subject.poses, FusionConfig(), workers=workers)


def _voxel(subject: Subject) -> float:
    return voxel_edge(subject.scans, FusionConfig())


def _laid(subject: Subject, mesh: TriangleMesh) -> Laid:
    """Distances after one rigid ICP."""
    pose = fit_surface(mesh, subject.reference)
    moved = replace(mesh, vertices=pose.apply(mesh.vertices))
    points, _ = sample_surface(moved, NUM_SAMPLES, np.random.default_rng(0))
    return Laid(
        accuracy=surface_distances(points, subject.reference),
        from_seen=surface_distances(subject.seen, moved),
    )


def _together(shapes: Sequence[Shape]) -> TriangleMesh:
    """All scans' own surfaces as one mesh."""
    starts = np.cumsum([0, *(len(shape.points) for shape in shapes[:-1])])
    return TriangleMesh(
        vertices=np.concatenate([shape.world_points for shape in shapes]),
        faces=np.concatenate([s.faces + k for s, k in zip(shapes, starts, strict=True)]),
    )


def _single(subject: Subject, shapes: Sequence[Shape]) -> Laid:
    """Each scan by itself: all their distances, and for each point the median of the scans."""
    each = []
    for shape in shapes:
        mesh = TriangleMesh(vertices=shape.world_points, faces=shape.faces)
        each.append(_laid(subject, mesh))
    from_seen = np.array([laid.from_seen for laid in each])
    covers = from_seen <= COMMON_RESOLUTIONS * subject.resolution
    middle, covered = np.full(len(subject.seen), np.inf), covers.any(axis=0)
    middle[covered] = np.nanmedian(np.where(covers, from_seen, np.nan)[:, covered], axis=0)
    return Laid(accuracy=np.concatenate([laid.accuracy for laid in each]), from_seen=middle)


def _found(
    scans: Sequence[RangeScan],
    prepared: Sequence[PreparedScan],
    truth: Mapping[str, Pose],
    workers: int,
) -> list[Pose]:
    """Poses that scanweld finds, world_from_sensor, in the frame of the first scan's true pose."""
    result = reconstruct(scans, Config(fusion=FusionConfig(voxel_resolutions=4.0)), workers=workers)
    names = [scan.name for scan in prepared]
    if len(result.components) != 1 or set(result.components[0]) != set(names):
        raise RuntimeError(f"not all scans were placed: {result.reasons}")
    world = truth[names[0]] @ result.poses[names[0]].inverse()
    return [world @ result.poses[scan.name] @ scan.scan_from_sensor for scan in prepared]


def _seen(
    mesh: TriangleMesh, scans: Sequence[RangeScan], truth: Mapping[str, Pose], footprint: float
) -> FloatArray:
    """Points (N, 3) spread over what at least one sensor saw of a mesh."""
    points, face_of = sample_surface(mesh, NUM_SAMPLES, np.random.default_rng(0))
    normals = face_normals(mesh.vertices, mesh.faces)[face_of]
    seen = np.zeros(len(points), dtype=bool)
    for scan in scans:
        seen |= _seen_by(mesh, points, normals, scan, truth[scan.name], footprint)
    return points[seen]


def _seen_by(
    mesh: TriangleMesh,
    points: FloatArray,
    normals: FloatArray,
    scan: RangeScan,
    world_from_scan: Pose,
    footprint: float,
) -> BoolArray:
    assert scan.camera is not None
    sensor_from_world = (world_from_scan @ scan.sensor_pose).inverse()
    # Finer than the sensor: what lies between its pixels' rays was seen.
    fine = 4
    camera = replace(
        scan.camera,
        width=fine * scan.camera.width,
        height=fine * scan.camera.height,
        fx=fine * scan.camera.fx,
        fy=fine * scan.camera.fy,
        cx=fine * scan.camera.cx,
        cy=fine * scan.camera.cy,
    )
    depth, _ = render_depth(sensor_from_world.apply(mesh.vertices), mesh.faces, camera)
    local = sensor_from_world.apply(points)
    pixels, z = camera.project(local)
    column, row = np.rint(pixels).astype(np.int64).T
    inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    at = depth[np.where(inside, row, 0), np.where(inside, column, 0)]
    rays = camera.view_directions(local)
    faces_it = np.einsum("nk,nk->n", sensor_from_world.turn(normals), rays) < 0
    return inside & faces_it & (np.abs(at - z) < footprint)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="How good the fused model is.")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--data", type=Path, help="folder of the Stanford data")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, help="JSON file of all records")
    parser.add_argument("--fuse", nargs=2, type=Path, metavar=("SCANS", "TOLD"))
    return parser.parse_args()


if __name__ == "__main__":
    given = _options()
    if given.fuse:
        fuse_folder(given.fuse[0], given.fuse[1], given.workers)
        sys.exit(0)
    sys.exit(main())
