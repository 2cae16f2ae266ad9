"""Scans with poses and the surface that they show: what models of them are held against."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from benchmarks.results import Json
from benchmarks.surface.open3d_fusion import Shape, poisson, shape_of, tsdf
from benchmarks.surface.surface_defects import surface_defects
from benchmarks.surface.surface_distances import sample_surface, surface_distances
from scanweld.config import FusionConfig
from scanweld.evaluation.turntable import joined
from scanweld.fusion import fuse, voxel_edge
from scanweld.geometry.arrays import BoolArray, FloatArray, IntArray
from scanweld.geometry.gauss_newton import damped, jacobian, motion_of, spread_of, tukey_weights
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.rasterize import render_depth
from scanweld.geometry.scan import RangeScan

COMMON_RESOLUTIONS = 2.0
"""Where every surface has something within this, they are compared."""
_NUM_ROUNDS = 30
_STILL = 1e-7
"""Steps shorter than this share of the reference's extent have arrived."""
Rival = Callable[[Sequence[Shape], float], TriangleMesh]
RIVALS: Mapping[str, Rival] = {"Open3D TSDF": tsdf, "Open3D Poisson": poisson}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Subject:
    """Scans with poses, and the surface that they show."""

    kind: str  # Virtual or real
    name: str  # In the tables
    scans: Sequence[PreparedScan]
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
        pose = _fit_surface(mesh, self.reference, num_samples=self.num_samples // 2)
        moved = replace(mesh, vertices=pose.apply(mesh.vertices))
        points, _ = sample_surface(moved, self.num_samples, np.random.default_rng(0))
        return surface_distances(points, self.reference), surface_distances(self.seen, moved)


def compared(subject: Subject, workers: int, rivals: Mapping[str, Rival]) -> list[Json]:
    """Our model, its rivals and the scans themselves, from the same poses."""
    shapes = [shape_of(*posed) for posed in zip(subject.scans, subject.poses, strict=True)]
    models, seconds = {}, {"single scans": 0.0}
    for name, make in {"scanweld": None, **rivals}.items():
        start = time.perf_counter()
        models[name] = make(shapes, subject.voxel) if make else subject.fused(workers)
        seconds[name] = time.perf_counter() - start
    laid = {name: subject.distances(mesh) for name, mesh in models.items()}
    meshes = [TriangleMesh(vertices=s.world_points, faces=s.mesh.faces) for s in shapes]
    models["single scans"], laid["single scans"] = joined(*meshes), _single(subject, meshes)
    reach = COMMON_RESOLUTIONS * subject.resolution
    common = np.all([from_seen <= reach for _, from_seen in laid.values()], axis=0)
    records = [fidelity(subject, models["scanweld"])]
    for name, (accuracy, from_seen) in laid.items():
        precision = float(np.mean(accuracy <= subject.resolution))
        recall = float(np.mean(from_seen <= subject.resolution))
        median, most = np.percentile(from_seen[common], [50, 90]) / subject.resolution
        records.append(
            {
                **{"kind": "rivals", "subject": subject.name, "model": name},
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
        **{"kind": subject.kind, "subject": subject.name},
        "accuracy_median": float(median),
        "accuracy_90": float(most),
        "completeness": float(np.mean(from_seen <= subject.resolution)),
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        **asdict(surface_defects(mesh, subject.voxel)),
        "stdev": float(np.nanmedian(mesh.stdev)) / unit if mesh.stdev is not None else None,
    }


def _single(subject: Subject, meshes: Sequence[TriangleMesh]) -> tuple[FloatArray, FloatArray]:
    """All distances of scans, and of each point that was seen the median over the scans."""
    accuracies, distances = zip(*map(subject.distances, meshes), strict=True)
    from_seen = np.array(distances)
    covers = from_seen <= COMMON_RESOLUTIONS * subject.resolution
    middle, covered = np.full(len(subject.seen), np.inf), covers.any(axis=0)
    middle[covered] = np.nanmedian(np.where(covers, from_seen, np.nan)[:, covered], axis=0)
    return np.concatenate(accuracies), middle


def _fit_surface(model: TriangleMesh, reference: TriangleMesh, *, num_samples: int) -> Pose:
    """Point-to-plane ICP of samples of a model that lies nearly right: reference_from_model."""
    rng = np.random.default_rng(0)
    moving, _ = sample_surface(model, num_samples, rng)
    target, face_of = sample_surface(reference, num_samples, rng)
    normals = face_normals(reference.vertices, reference.faces)[face_of]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centre, tree, pose = target.mean(axis=0), KDTree(target), Pose.identity()
    arm = float(np.linalg.norm(np.ptp(target, axis=0)))
    for _ in range(_NUM_ROUNDS):
        points = pose.apply(moving)
        nearest = tree.query(points)[1]
        residuals = np.einsum("nk,nk->n", points - target[nearest], normals[nearest])
        weights = tukey_weights(residuals, spread_of(residuals, 1e-9 * arm))
        rows = jacobian(points, normals[nearest], centre, arm)
        normal = damped(rows.T @ (weights[:, None] * rows))
        twist = -np.linalg.solve(normal, rows.T @ (weights * residuals))
        pose = motion_of(twist, centre, arm) @ pose
        if float(np.linalg.norm(twist)) < _STILL * arm:
            break
    return pose


def seen_of(
    mesh: TriangleMesh,
    points: FloatArray,
    face_of: IntArray,
    scans: Sequence[RangeScan],
    truth: Mapping[str, Pose],
    footprint: float,
) -> BoolArray:
    """Which points (N, 3) of a mesh's faces (N,) at least one sensor saw: (N,)."""
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
    return seen
