"""The joint refinement: exact truth from rendered scans, invariances, and what must not move."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import combinations

import numpy as np
import pytest

from scanweld.config import ContoursConfig, PrepareConfig, RefineConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.evidence.evidence import Evidence
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.pose import Pose, random_rotation, rotation_exp
from scanweld.geometry.prepared import PreparedScan
from scanweld.graph.refine_graph import Refined, refine_graph
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.pairs.result import Alternative
from scanweld.preparation import prepare
from scanweld.refinement.refine import Refinement, refine_poses, scan_rms
from scanweld.refinement.surface_terms import surface_matches, surface_source
from tests.prepared import scaled
from tests.scenes import creature_scene
from tests.view_graphs import DrawnJudge

NUM_SCANS = 6
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


def assert_same(a: Refinement, b: Refinement, size: float) -> None:
    for k, pose in a.poses.items():
        np.testing.assert_allclose(pose.rotation, b.poses[k].rotation, atol=1e-6)
        np.testing.assert_allclose(pose.translation, b.poses[k].translation, atol=1e-6 * size)


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


def test_first_scan_is_the_gauge():
    scans, truth = ring()
    refined = refine_poses(scans, start(1.0, 0.01), RING, RefineConfig())
    assert refined.poses[0] is truth[0]
    assert set(refined.poses) == set(truth)


def test_order_of_the_mapping_does_not_matter():
    scans, _ = ring()
    poses = start(1.0, 0.01)
    a = refine_poses(scans, poses, RING, RefineConfig())
    b = refine_poses(scans, dict(reversed(poses.items())), RING[::-1], RefineConfig())
    for k in poses:
        assert a.poses[k].matrix().tobytes() == b.poses[k].matrix().tobytes()


def test_numbering_of_the_scans_does_not_matter():
    """Another first scan is another gauge; the poses between the scans stay."""
    scans, _ = ring()
    poses = start(1.0, 0.01)
    order = [3, 0, 5, 1, 4, 2]
    all_pairs = list(combinations(range(NUM_SCANS), 2))
    a = refine_poses(scans, poses, all_pairs, RefineConfig()).poses
    shuffled = {n: poses[k] for n, k in enumerate(order)}
    b = refine_poses([scans[k] for k in order], shuffled, all_pairs, RefineConfig()).poses
    gauge = a[order[0]] @ b[0].inverse()
    for n, k in enumerate(order):
        off = a[k].inverse() @ gauge @ b[n]
        assert off.angle_deg() < 0.02
        assert off.shift_at(scans[k].mesh.vertices.mean(axis=0)) < 1e-4 * scans[0].diameter


def test_unit_of_length_does_not_matter():
    scans, _ = ring()
    large, _ = ring(factor=1000.0)
    a = refine_poses(scans, start(1.0, 0.01), RING, RefineConfig())
    b = refine_poses(large, start(1.0, 0.01, factor=1000.0), RING, RefineConfig())
    shrunk = {
        k: Pose(rotation=pose.rotation, translation=pose.translation / 1000.0)
        for k, pose in b.poses.items()
    }
    assert_same(a, Refinement(poses=shrunk, pairs={}, rms=0.0, step=0.0), scans[0].diameter)
    assert b.rms == pytest.approx(1000.0 * a.rms, rel=1e-4)


def test_moving_the_world_moves_the_poses():
    scans, _ = ring()
    poses = start(1.0, 0.01)
    motion = Pose(rotation=random_rotation(np.random.default_rng(5)), translation=np.ones(3))
    a = refine_poses(scans, poses, RING, RefineConfig())
    b = refine_poses(scans, {k: motion @ p for k, p in poses.items()}, RING, RefineConfig())
    moved = {k: motion @ pose for k, pose in a.poses.items()}
    assert_same(Refinement(poses=moved, pairs={}, rms=0, step=0), b, scans[0].diameter)


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


def test_residuals_say_how_pairs_lie():
    scans, truth = ring()
    refined = refine_poses(scans, truth, RING, RefineConfig())
    for pair in RING:
        residual = refined.pairs[min(pair), max(pair)]
        assert residual.num_matches > 150
        assert 0 < residual.rms < 0.5 * scans[0].image.pixel


def test_matches_lie_on_the_other_surface():
    """At the truth the distances are a small share of a pixel; a rim is never matched."""
    scans, truth = ring()
    i, j = (surface_source(scans[k], 2000) for k in (0, 1))
    matches = surface_matches(i, j, truth[1].inverse() @ truth[0], 0.02 * scans[0].diameter)
    assert len(matches) > 100
    assert np.median(np.abs(matches.residuals)) < 0.2 * scans[1].image.pixel
    pixels, _ = scans[1].image.camera.project(
        matches.points - matches.residuals[:, None] * matches.directions
    )
    columns, rows = np.rint(pixels).astype(int).T
    assert scans[1].image.is_rim[rows, columns].mean() < 0.05


def test_back_sides_do_not_match():
    """A thin wall's two sides lie within the radius, but look different ways."""
    scans, _ = ring()
    flip = Pose(rotation=np.diag([-1.0, 1.0, -1.0]), translation=np.zeros(3))
    source = surface_source(scans[0], 2000)
    middle = source.points.mean(axis=0)
    turned = Pose(rotation=flip.rotation, translation=middle - flip.rotation @ middle)
    assert not len(surface_matches(source, source, turned, 1e-3 * scans[0].diameter))
    assert len(surface_matches(source, source, Pose.identity(), 1e-3 * scans[0].diameter)) > 1000


def graph_at(poses: Mapping[int, Pose]) -> ViewGraph:
    """One component of all scans, neighbours joined."""
    to_reference = poses[1].inverse()
    component = Component(poses={k: to_reference @ pose for k, pose in poses.items()}, reference=1)
    accepted = {
        (min(edge), max(edge)): Alternative(i_from_j=Pose.identity(), evidence=evidence(agree=1.0))
        for edge in RING
    }
    return ViewGraph(
        pairs={}, usable={}, accepted=accepted, rejected={}, components=(component,), unplaced={}
    )


def evidence(agree: float) -> Evidence:
    return Evidence(
        agree=agree, front=0.0, contradict=0.0, free=0.0, occluded=1.0 - agree, unknown=0.0
    )


@pytest.mark.parametrize("is_better", [True, False])
def test_a_refinement_is_taken_only_if_the_evidence_does_not_suffer(is_better: bool):
    scans, truth = ring()
    graph = graph_at(start(1.0, 0.005))
    before = graph.components[0].poses

    def judge(i: int, j: int, i_from_j: Pose) -> Evidence:
        is_start = (before[i].inverse() @ before[j]).inverse() @ i_from_j
        return evidence(0.5 if (is_start.angle_deg() < 1e-9) == is_better else 0.6)

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
