"""The joint refinement: exact truth, invariances."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import combinations

import numpy as np
import pytest

from scanweld.config import ContoursConfig, PrepareConfig, RefineConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.evidence.evidence import Evidence
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.prepared import PreparedScan
from scanweld.graph.refine_graph import Refined, refine_graph
from scanweld.graph.view_graph import Component, Edge
from scanweld.pairs.result import PairKind
from scanweld.preparation import prepare
from scanweld.refinement.refine import refine_poses, scan_rms
from scanweld.refinement.surface_terms import surface_matches, surface_source
from tests.prepared import scaled
from tests.scenes import creature_scene, random_motion
from tests.view_graphs import DrawnJudge, graph_with, option, pair_of, seen

NUM_SCANS = 6
ALL = list(combinations(range(NUM_SCANS), 2))
RING = [(k, (k + 1) % NUM_SCANS) for k in range(NUM_SCANS)]


@lru_cache
def ring(
    model: CameraModel = CameraModel.PINHOLE, factor: float = 1.0
) -> tuple[tuple[PreparedScan, ...], dict[int, Pose]]:
    """Scans around the creature and their true ``world_from_sensor``."""
    scene = creature_scene(NUM_SCANS, pixels=240, model=model)
    scans = tuple(prepare(scaled(scan, factor), PrepareConfig()) for scan in scene.scans)
    truth = {}
    for k, scan in enumerate(scans):
        true = scene.world_from_scan[scan.name]
        world = Pose(rotation=true.rotation, translation=factor * true.translation)
        truth[k] = world @ scan.scan_from_sensor
    return scans, truth


def nudged(scan: PreparedScan, pose: Pose, degrees: float, share: float, seed: int) -> Pose:
    """A pose turned about the scan's middle and shifted by a share of its diameter."""
    rng = np.random.default_rng(seed)
    axis, shift = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    rotation = rotation_exp(np.radians(degrees) * axis)
    middle = pose.apply(scan.mesh.vertices.mean(axis=0))
    moved = middle + share * scan.diameter * shift
    return Pose(rotation=rotation, translation=moved - rotation @ middle) @ pose


def start(degrees: float, share: float, **which: float) -> dict[int, Pose]:
    scans, truth = ring(**which)  # pyright: ignore[reportArgumentType]
    return {
        k: pose if k == 0 else nudged(scans[k], pose, degrees, share, k)
        for k, pose in truth.items()
    }


def errors(
    scans: Sequence[PreparedScan], truth: Mapping[int, Pose], poses: Mapping[int, Pose]
) -> tuple[float, float]:
    """Mean rotation error in degrees and mean shift in diameters, the first scan's gauge."""
    off = [truth[k].inverse() @ poses[k] for k in truth if k]
    middles = [scans[k].mesh.vertices.mean(axis=0) for k in truth if k]
    shifts = [pose.shift_at(middle) for pose, middle in zip(off, middles, strict=True)]
    return float(np.mean([p.angle_deg() for p in off])), float(np.mean(shifts)) / scans[0].diameter


def assert_same(a: Mapping[int, Pose], b: Mapping[int, Pose], size: float) -> None:
    for k, pose in a.items():
        np.testing.assert_allclose(pose.rotation, b[k].rotation, atol=1e-6)
        np.testing.assert_allclose(pose.translation, b[k].translation, atol=1e-6 * size)


@pytest.mark.parametrize("model", [CameraModel.PINHOLE, CameraModel.ORTHOGRAPHIC])
@pytest.mark.parametrize(("degrees", "share"), [(0.0, 0.0), (3.0, 0.02)])
@pytest.mark.parametrize("with_contours", [False, True])
def test_truth_is_kept_and_found(
    model: CameraModel, degrees: float, share: float, with_contours: bool
):
    """A pixel of these scans is 0.4 % of the diameter: right to a twentieth of it."""
    scans, truth = ring(model=model)
    contours = contour_matcher(scans, ContoursConfig()) if with_contours else None
    poses = start(degrees, share, model=model)
    refined = refine_poses(scans, poses, RING, RefineConfig(), contours)
    angle, shift = errors(scans, truth, refined.poses)
    assert angle < 0.06
    assert shift < 2e-4
    assert refined.step < 1e-4


def test_order_unit_and_frame_do_not_matter():
    """The first scan is the gauge."""
    scans, truth = ring()
    poses, config = start(1.0, 0.01), RefineConfig()
    a = refine_poses(scans, poses, RING, config)
    assert a.poses[0] is truth[0] and set(a.poses) == set(truth)
    b = refine_poses(scans, dict(reversed(poses.items())), RING[::-1], config)
    c = refine_poses(scans, poses, RING, config, workers=2)
    for k in poses:
        for other in (b, c):
            assert a.poses[k].matrix().tobytes() == other.poses[k].matrix().tobytes()
    far = refine_poses(ring(factor=1000.0)[0], start(1.0, 0.01, factor=1000.0), RING, config)
    shrunk = {
        k: Pose(rotation=pose.rotation, translation=pose.translation / 1000.0)
        for k, pose in far.poses.items()
    }
    assert_same(a.poses, shrunk, scans[0].diameter)
    assert far.rms == pytest.approx(1000.0 * a.rms, rel=1e-4)
    motion = random_motion(np.random.default_rng(5), 1.0)
    there = refine_poses(scans, {k: motion @ p for k, p in poses.items()}, RING, config)
    assert_same({k: motion @ p for k, p in a.poses.items()}, there.poses, scans[0].diameter)


def test_numbering_of_the_scans_does_not_matter():
    """Another first scan is another gauge; the poses between the scans stay."""
    scans, _ = ring()
    poses = start(1.0, 0.01)
    order = [3, 0, 5, 1, 4, 2]
    a = refine_poses(scans, poses, ALL, RefineConfig()).poses
    shuffled = {n: poses[k] for n, k in enumerate(order)}
    b = refine_poses([scans[k] for k in order], shuffled, ALL, RefineConfig()).poses
    gauge = a[order[0]] @ b[0].inverse()
    for n, k in enumerate(order):
        off = a[k].inverse() @ gauge @ b[n]
        assert off.angle_deg() < 0.02
        assert off.shift_at(scans[k].mesh.vertices.mean(axis=0)) < 1e-4 * scans[0].diameter


def test_scans_that_touch_nothing_stay():
    scans, truth = ring()
    away = Pose(rotation=np.eye(3), translation=np.array([0.0, 0.0, 20 * scans[0].diameter]))
    poses = {0: truth[0], 1: nudged(scans[1], truth[1], 1.0, 0.01, 1), 3: away @ truth[3]}
    refined = refine_poses(scans, poses, [(0, 1), (1, 3)], RefineConfig())
    assert set(refined.pairs) == {(0, 1)}
    np.testing.assert_allclose(refined.poses[3].matrix(), poses[3].matrix(), atol=1e-9)
    alone = refine_poses(scans, {2: truth[2]}, [], RefineConfig())
    assert alone.poses == {2: truth[2]}
    assert alone.pairs == {}


def test_matches_lie_on_the_other_surface():
    """At the truth the distances are a small share of a pixel; a rim or a back is never matched."""
    scans, truth = ring()
    residuals = refine_poses(scans, truth, RING, RefineConfig()).pairs
    for pair in RING:
        residual = residuals[min(pair), max(pair)]
        assert residual.num_matches > 150
        assert 0 < residual.rms < 0.5 * scans[0].image.pixel
    i, j = (surface_source(scans[k], 2000) for k in (0, 1))
    matches = surface_matches(i, j, truth[1].inverse() @ truth[0], 0.02 * scans[0].diameter)
    assert len(matches) > 100
    assert np.median(np.abs(matches.residuals)) < 0.2 * scans[1].image.pixel
    pixels, _ = scans[1].image.camera.project(
        matches.points - matches.residuals[:, None] * matches.directions
    )
    columns, rows = np.rint(pixels).astype(int).T
    assert scans[1].image.is_rim[rows, columns].mean() < 0.05
    # A thin wall's two sides lie within the radius, but look different ways.
    flip, middle = np.diag([-1.0, 1.0, -1.0]), i.points.mean(axis=0)
    turned = Pose(rotation=flip, translation=middle - flip @ middle)
    assert not len(surface_matches(i, i, turned, 1e-3 * scans[0].diameter))
    assert len(surface_matches(i, i, Pose.identity(), 1e-3 * scans[0].diameter)) > 1000


@pytest.mark.parametrize("is_better", [True, False])
def test_a_refinement_is_taken_only_if_the_evidence_does_not_suffer(is_better: bool):
    scans, truth = ring()
    poses = start(1.0, 0.005)
    before = {k: poses[1].inverse() @ pose for k, pose in poses.items()}
    edges = [(min(edge), max(edge)) for edge in RING]
    pairs = {edge: pair_of(*edge, PairKind.GOOD, option(Pose.identity(), 1.0)) for edge in edges}
    graph = graph_with({}, Component(poses=before, reference=1), accepted=pairs)

    def judge(i: int, j: int, i_from_j: Pose) -> Evidence:
        is_start = (before[i].inverse() @ before[j]).inverse() @ i_from_j
        return seen(0.5 if (is_start.angle_deg() < 1e-9) == is_better else 0.6)

    matcher = contour_matcher(scans, ContoursConfig())

    def refine(poses: Mapping[int, Pose], edges: Sequence[Edge], _: Sequence[Edge]) -> Refined:
        found = refine_poses(scans, poses, edges, RefineConfig(), matcher)
        return found.poses, scan_rms(found)

    refined = refine_graph(graph, refine, DrawnJudge(says=judge))
    poses = refined.components[0].poses
    np.testing.assert_allclose(poses[1].matrix(), np.eye(4), atol=1e-12)
    if not is_better:
        assert poses == before and not refined.rms
        return
    to_truth = truth[1].inverse()
    for k, pose in truth.items():
        assert ((to_truth @ pose).inverse() @ poses[k]).angle_deg() < 0.1
    assert set(refined.rms) == set(truth)
