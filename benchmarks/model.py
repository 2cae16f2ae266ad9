"""How good the fused model is, as Markdown tables; Open3D's fusion beside ours.

    python -m benchmarks.model --out docs/data/model.json
    python -m benchmarks.model --quick

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

import numpy as np

from benchmarks.blocks import judged, markdown_table
from benchmarks.results import Json, write_results
from benchmarks.run import timed
from benchmarks.sets import BUNNY, data_folder
from benchmarks.surface.open3d_fusion import Shape, poisson, shape_of, tsdf
from benchmarks.surface.surface_defects import surface_defects
from benchmarks.surface.surface_fit import fit_surface
from scanweld.config import Config, FusionConfig
from scanweld.evaluation.creature import creature
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.simulate import simulate
from scanweld.evaluation.surface_errors import sample_surface, surface_distances
from scanweld.fusion import fuse, voxel_edge
from scanweld.geometry.arrays import FloatArray
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

NOISE = 0.001
"""Of depth, in diameters of the virtual object."""
COMMON_RESOLUTIONS = 2.0
"""Where every surface has something within this, they are compared."""
Rival = Callable[[Sequence[Shape], float], TriangleMesh]
RIVALS: Mapping[str, Rival] = {"Open3D TSDF": tsdf, "Open3D Poisson": poisson}
FLOORS = {
    "virtual": {"accuracy_90": 0.6, "completeness": 0.98},
    "real": {"accuracy_median": 0.15, "accuracy_90": 0.40},
    "many": {"peak_mb": 3072.0, "fusion_seconds": 180.0},
}
"""Accuracies in footprints (virtual) and millimetres (real)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Size:
    """Virtual scans, a pixel's footprint in object diameters, samples of a surface, many scans."""

    num_views: int = 12
    footprint: float = 0.0045
    num_samples: int = 100_000
    many: int = 60
    many_pixels: float = 1480.0


QUICK = Size(num_views=6, footprint=0.008, num_samples=8000, many=3, many_pixels=80.0)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Subject:
    """Scans with poses, and the surface that they show."""

    kind: str  # Virtual or real
    name: str  # In the tables
    scans: Sequence[PreparedScan]  # Prepared
    poses: Sequence[Pose]  # world_from_sensor of each
    reference: TriangleMesh  # The surface, in about the same frame
    seen: FloatArray  # (N, 3) points spread over the part of it that was seen
    resolution: float  # Of the scans
    num_samples: int  # Of a surface

    @property
    def voxel(self) -> float:
        """Edge of a voxel."""
        return voxel_edge(self.scans, FusionConfig())

    def fused(self, workers: int) -> TriangleMesh:
        """Our model."""
        return fuse(self.scans, self.poses, FusionConfig(), workers=workers)

    def distances(self, mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
        """Of the model from the reference, and of what was seen from the model; after one ICP."""
        pose = fit_surface(mesh, self.reference, num_samples=self.num_samples // 2)
        moved = replace(mesh, vertices=pose.apply(mesh.vertices))
        points, _ = sample_surface(moved, self.num_samples, np.random.default_rng(0))
        return surface_distances(points, self.reference), surface_distances(self.seen, moved)


def main() -> int:
    """Measure; print the tables."""
    options = _options()
    if options.fuse:
        fuse_folder(options.fuse[0], options.fuse[1], options.workers)
        return 0
    kinds = {"virtual": virtual, "real": real, "many": many}
    records: list[Json] = []
    for kind in ("virtual", "many") if options.quick else options.kinds:
        with single_threaded_algebra():
            records += kinds[kind](options)
        if options.out:
            write_results(options.out, records)
    print("\n".join(table(records) for table in (fidelity_table, rivals_table, many_table)))
    return 0


def virtual(options: argparse.Namespace) -> list[Json]:
    """The armadillo, scanned by a virtual scanner."""
    mesh, name, size = _virtual_object(options)
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder, noise = Path(temporary) / "scans", NoiseModel(depth_diameters=NOISE)
        truth = simulate(
            mesh, folder, num_scans=size.num_views, pixels=1 / size.footprint, noise=noise
        ).poses
        scans = [read_scan(path) for path in sorted(folder.glob("*.ply"))]
    prepared = [prepare(scan, Config().prepare) for scan in scans]
    resolution = size.footprint * float(np.median([scan.diameter for scan in prepared]))
    right = Subject(
        kind="virtual",
        name=f"{name}, true poses",
        scans=prepared,
        poses=[truth[scan.name] @ scan.scan_from_sensor for scan in prepared],
        reference=mesh,
        seen=_seen(mesh, scans, truth, resolution, size.num_samples),
        resolution=resolution,
        num_samples=size.num_samples,
    )
    found = replace(right, name=name, poses=_found(scans, prepared, truth, options.workers))
    records = compared(found, options.workers, {} if options.quick else RIVALS)
    return [*records, fidelity(right, right.fused(options.workers))]


def real(options: argparse.Namespace) -> list[Json]:
    """The bunny's ten scans."""
    folder = data_folder(options.data) / "stanford-bunny"
    scans = [read_scan(folder / f"{name}.ply") for name in BUNNY]
    reference = read_mesh(folder / "bun_zipper.ply")
    prepared = [prepare(scan, Config().prepare) for scan in scans]
    truth, num_samples = read_poses(folder / "poses.json").poses, Size().num_samples
    subject = Subject(
        kind="real",
        name="bunny",
        scans=prepared,
        poses=_found(scans, prepared, truth, options.workers),
        reference=reference,
        seen=sample_surface(reference, num_samples, np.random.default_rng(0))[0],
        resolution=float(np.median([scan.resolution for scan in prepared])),
        num_samples=num_samples,
    )
    return compared(subject, options.workers)


def many(options: argparse.Namespace) -> list[Json]:
    """Many scans, from files to a mesh, in a process of its own."""
    mesh, _, size = _virtual_object(options)
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder, out = Path(temporary) / "scans", Path(temporary) / "told.txt"
        simulate(mesh, folder, num_scans=size.many, pixels=size.many_pixels)
        command = [sys.executable, "-m", "benchmarks.model", "--fuse", str(folder), str(out)]
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


def compared(subject: Subject, workers: int, rivals: Mapping[str, Rival] = RIVALS) -> list[Json]:
    """Our model, its rivals and the scans themselves, from the same poses."""
    posed = zip(subject.scans, subject.poses, strict=True)
    shapes = [shape_of(scan, pose) for scan, pose in posed]
    makers = {
        "scanweld": lambda: subject.fused(workers),
        **{name: lambda make=make: make(shapes, subject.voxel) for name, make in rivals.items()},
    }
    models, seconds = {}, {"single scans": 0.0}
    for name, make in makers.items():
        start = time.perf_counter()
        models[name] = make()
        seconds[name] = time.perf_counter() - start
    laid = {name: subject.distances(mesh) for name, mesh in models.items()}
    models["single scans"], laid["single scans"] = _single(subject, shapes)
    reach = COMMON_RESOLUTIONS * subject.resolution
    common = np.all([from_seen <= reach for _, from_seen in laid.values()], axis=0)
    records = [fidelity(subject, models["scanweld"])]
    for name, (accuracy, from_seen) in laid.items():
        precision = float(np.mean(accuracy <= subject.resolution))
        recall = float(np.mean(from_seen <= subject.resolution))
        median, most = np.percentile(from_seen[common], [50, 90]) / subject.resolution
        records.append(
            {
                "kind": "rivals",
                "subject": subject.name,
                "model": name,
                "faces": len(models[name].faces),
                "precision": precision,
                "recall": recall,
                "f_score": 2 * precision * recall / (precision + recall),
                "common": float(common.mean()),
                "common_median": float(median),
                "common_90": float(most),
                **asdict(surface_defects(models[name], subject.voxel)),
                "seconds": seconds[name],
            }
        )
    return records


def fidelity(subject: Subject, mesh: TriangleMesh) -> Json:
    """How near our model comes to the reference, in resolutions or, of real scans, in mm."""
    accuracy, from_seen = subject.distances(mesh)
    unit = 1e-3 if subject.kind == "real" else subject.resolution
    median, most = np.percentile(accuracy, [50, 90]) / unit
    return {
        "kind": subject.kind,
        "subject": subject.name,
        "accuracy_median": float(median),
        "accuracy_90": float(most),
        "completeness": float(np.mean(from_seen <= subject.resolution)),
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        **asdict(surface_defects(mesh, subject.voxel)),
        "stdev": float(np.nanmedian(mesh.stdev)) / unit if mesh.stdev is not None else None,
    }


def _single(
    subject: Subject, shapes: Sequence[Shape]
) -> tuple[TriangleMesh, tuple[FloatArray, FloatArray]]:
    """All scans as one mesh; all their distances, and of each point the median of the scans."""
    meshes = [TriangleMesh(vertices=s.world_points, faces=s.mesh.faces) for s in shapes]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    together = TriangleMesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate([m.faces + k for m, k in zip(meshes, starts, strict=True)]),
    )
    accuracies, distances = zip(*map(subject.distances, meshes), strict=True)
    from_seen = np.array(distances)
    covers = from_seen <= COMMON_RESOLUTIONS * subject.resolution
    middle, covered = np.full(len(subject.seen), np.inf), covers.any(axis=0)
    middle[covered] = np.nanmedian(np.where(covers, from_seen, np.nan)[:, covered], axis=0)
    return together, (np.concatenate(accuracies), middle)


def _virtual_object(options: argparse.Namespace) -> tuple[TriangleMesh, str, Size]:
    if options.quick:
        return creature(voxels=100), "creature", QUICK
    return read_mesh(data_folder(options.data) / "meshes/armadillo.ply"), "armadillo", Size()


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
    mesh: TriangleMesh,
    scans: Sequence[RangeScan],
    truth: Mapping[str, Pose],
    footprint: float,
    num_samples: int,
) -> FloatArray:
    """Points (N, 3) spread over what at least one sensor saw of a mesh."""
    points, face_of = sample_surface(mesh, num_samples, np.random.default_rng(0))
    normals = face_normals(mesh.vertices, mesh.faces)[face_of]
    seen = np.zeros(len(points), dtype=bool)
    for scan in scans:
        assert scan.camera is not None
        sensor_from_world = (truth[scan.name] @ scan.sensor_pose).inverse()
        # Finer than the sensor: what lies between its pixels' rays was seen.
        names = ("width", "height", "fx", "fy", "cx", "cy")
        camera = replace(scan.camera, **{name: 4 * getattr(scan.camera, name) for name in names})
        depth, _ = render_depth(sensor_from_world.apply(mesh.vertices), mesh.faces, camera)
        local = sensor_from_world.apply(points)
        pixels, z = camera.project(local)
        column, row = np.rint(pixels).astype(np.int64).T
        inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
        at = depth[np.where(inside, row, 0), np.where(inside, column, 0)]
        rays = camera.view_directions(local)
        faces_it = np.einsum("nk,nk->n", sensor_from_world.turn(normals), rays) < 0
        seen |= inside & faces_it & (np.abs(at - z) < footprint)
    return points[seen]


def fidelity_table(records: Sequence[Json]) -> str:
    """Markdown: our model against the reference, floors in brackets."""
    headings = (
        *("model", "unit", "median", "90 %", "completeness", "faces"),
        *("non-manifold", "double", "cracks", "estimated deviation"),
    )
    rows = [
        (
            *(r["subject"], "mm" if r["kind"] == "real" else "footprint"),
            *(_cell(r, key, 3) for key in ("accuracy_median", "accuracy_90")),
            *(_cell(r, "completeness", 4, at_least=True), r["faces"]),
            *(judged(f"{r[k]} (0)", r[k] == 0) for k in ("non_manifold", "double", "cracks")),
            f"{r['stdev']:.3f}",
        )
        for r in records
        if r["kind"] in ("virtual", "real")
    ]
    return markdown_table(headings, rows)


def rivals_table(records: Sequence[Json]) -> str:
    """Markdown: the surfaces of all methods from the same poses."""
    headings = (
        *("object", "surface", "F-score", "precision", "recall", "on common surface: median"),
        *("90 %", "faces", "non-manifold", "double", "cracks", "seconds"),
    )
    rows = [
        (
            *(r["subject"], r["model"]),
            *(f"{r[key]:.4f}" for key in ("f_score", "precision", "recall")),
            *(f"{r[key]:.3f}" for key in ("common_median", "common_90")),
            *(r[key] for key in ("faces", "non_manifold", "double", "cracks")),
            f"{r['seconds']:.0f}" if r["seconds"] else "-",
        )
        for r in records
        if r["kind"] == "rivals"
    ]
    return markdown_table(headings, rows)


def many_table(records: Sequence[Json]) -> str:
    """Markdown: what many scans cost."""
    headings = ("scans", "points each", "faces", "peak (MB)", "fusion wall / CPU (s)", "all (s)")
    rows = [
        (
            *(f"{r[key]:.0f}" for key in ("scans", "points", "faces")),
            _cell(r, "peak_mb", 0),
            f"{_cell(r, 'fusion_seconds', 0)} / {r['fusion_cpu_seconds']:.0f}",
            f"{r['seconds']:.0f}",
        )
        for r in records
        if r["kind"] == "many"
    ]
    return markdown_table(headings, rows)


def _cell(record: Json, key: str, digits: int, *, at_least: bool = False) -> str:
    """A value, its floor in brackets if it has one."""
    value, floor = record[key], FLOORS[record["kind"]].get(key)
    text = f"{value:.{digits}f}"
    if floor is None:
        return text
    return judged(f"{text} ({floor:g})", value >= floor if at_least else value <= floor)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="How good the fused model is.")
    kinds = ("virtual", "real", "many")
    parser.add_argument("--kinds", nargs="+", choices=kinds, default=list(kinds))
    parser.add_argument("--quick", action="store_true", help="small, of an object that it makes")
    parser.add_argument("--data", type=Path, help="folder of the Stanford data")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, help="JSON file of all records")
    parser.add_argument("--fuse", nargs=2, type=Path, metavar=("SCANS", "TOLD"))
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
