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
import json
import os
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.blocks import rendered
from benchmarks.captures import parser_of
from benchmarks.results import Json, write_results
from benchmarks.run import timed
from benchmarks.sets import OBJECTS, data_folder
from benchmarks.surface.subject import RIVALS, Subject, compared, fidelity, seen_of
from benchmarks.surface.surface_distances import sample_surface
from scanweld.config import Config, FusionConfig
from scanweld.evaluation.creature import creature
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.simulate import simulate
from scanweld.fusion import fuse
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_mesh, read_poses, read_scan
from scanweld.pipeline.run import run as reconstruct
from scanweld.preparation import prepare
from scanweld.work.stage_log import peak_memory_mb
from scanweld.work.threads import map_in_order, single_threaded_algebra

NOISE = 0.001
"""Of depth, in diameters of the virtual object."""
FLOORS = {
    "virtual": {"accuracy_90": 0.6, "completeness": 0.98},
    "real": {"accuracy_median": 0.15, "accuracy_90": 0.40},
    "many": {"peak_mb": 3072.0, "fusion_seconds": 180.0},
}
"""Accuracies in footprints (virtual) and millimetres (real)."""


class Size(NamedTuple):
    """Virtual scans, a pixel's footprint in object diameters, samples of a surface, many scans."""

    num_views: int = 12
    footprint: float = 0.0045
    num_samples: int = 100_000
    many: int = 60
    many_pixels: float = 1480.0


QUICK = Size(num_views=6, footprint=0.008, num_samples=8000, many=3, many_pixels=80.0)


def main() -> int:
    """Measure; print the tables."""
    kinds = {"virtual": virtual, "real": real, "many": many}
    parser = parser_of("How good the fused model is.", "kind", kinds)
    parser.add_argument("--fuse", nargs=2, type=Path, metavar=("SCANS", "TOLD"))
    options = parser.parse_args()
    if options.fuse:
        fuse_folder(options.fuse[0], options.fuse[1], options.workers)
        return 0
    records: list[Json] = []
    for kind in ("virtual", "many") if options.quick else options.kinds:
        with single_threaded_algebra():
            records += kinds[kind](options)
        if options.out:
            write_results(options.out, records)
    parts = ("model", "model-rivals", "model-many")
    print("\n".join(rendered(part, **by_kind(records)) for part in parts))
    return 0


def by_kind(records: Sequence[Json]) -> Json:
    """The records of each table, and the floors."""
    kinds = {"fidelity": ("virtual", "real"), "rivals": ("rivals",), "many": ("many",)}
    tables = {name: [r for r in records if r["kind"] in of] for name, of in kinds.items()}
    return {**tables, "all_floors": FLOORS}


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
    points, face_of = sample_surface(mesh, size.num_samples, np.random.default_rng(0))
    right = Subject(
        kind="virtual",
        name=f"{name}, true poses",
        scans=prepared,
        poses=[truth[scan.name] @ scan.scan_from_sensor for scan in prepared],
        reference=mesh,
        seen=points[seen_of(mesh, points, face_of, scans, truth, resolution)],
        resolution=resolution,
        num_samples=size.num_samples,
    )
    found = replace(right, name=name, poses=_found(scans, prepared, truth, options.workers))
    records = compared(found, options.workers, {} if options.quick else RIVALS)
    return [*records, fidelity(right, right.fused(options.workers))]


def real(options: argparse.Namespace) -> list[Json]:
    """The bunny's ten scans."""
    folder = data_folder(options.data) / "stanford-bunny"
    scans = [read_scan(folder / f"{name}.ply") for name in OBJECTS["bunny"].scans]
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
    return compared(subject, options.workers, RIVALS)


def many(options: argparse.Namespace) -> list[Json]:
    """Many scans, from files to a mesh, in a process of its own."""
    mesh, _, size = _virtual_object(options)
    with tempfile.TemporaryDirectory(prefix="scanweld-") as temporary:
        folder, out = Path(temporary) / "scans", Path(temporary) / "told.json"
        simulate(mesh, folder, num_scans=size.many, pixels=size.many_pixels)
        command = [sys.executable, "-m", "benchmarks.model", "--fuse", str(folder), str(out)]
        usage = timed([*command, "--workers", str(options.workers)], dict(os.environ))
        return [{"kind": "many", **json.loads(out.read_text()), **usage}]


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
        "scans": float(len(scans)),
        "points": float(np.mean([len(scan.scan.points) for scan in scans])),
        "faces": float(len(mesh.faces)),
    }
    out.write_text(json.dumps(told))


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


if __name__ == "__main__":
    sys.exit(main())
