"""How far silhouettes can be believed: trimmed scans say so, and pixels beside cuts are mute."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from scanweld.config import Config, FusionConfig
from scanweld.evidence.field import RASTER_OUTSIDE, with_margin
from scanweld.evidence.pixels import see
from scanweld.evidence.visibility import evidence_at_poses, mean_evidence
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan
from scanweld.graph.apart import MIN_SAYING, why_apart
from scanweld.graph.view_graph import Component
from scanweld.pairs.quick import search_quickly
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pipeline.run import run
from scanweld.sensor.certain import certain_pairs
from scanweld.sensor.silhouette import MAX_MARGIN_DIAMETERS, silhouette_margin
from tests.prepared import PreparedPair, creature_pair, prepared_pair
from tests.scenes import creature_scene, pair_at_gap
from tests.view_graphs import (
    CENTRE,
    SAME,
    exact_pairs,
    graph_with,
    option,
    pair_of,
    turn_about_centre,
    world_of,
)

LEAST = 0.012


def trimmed(scan: RangeScan, share: float, towards: float) -> RangeScan:
    """The scan without so much of it on one side, as cut off by hand."""
    along = scan.points @ [np.cos(towards), np.sin(towards), 0.0]
    return scan.only(along <= np.quantile(along, 1.0 - share))


def trimmed_pair(share: float) -> PreparedPair:
    """Two scans of the creature 30 deg apart, cut on opposite sides."""
    i, j, i_from_j = pair_at_gap(30, pixels=160.0, seed=30)
    return prepared_pair(trimmed(i, share, 0.3), trimmed(j, share, 3.4), i_from_j)


def margin_of(pair: PreparedPair) -> float:
    """What the pair says of its silhouettes at the true pose, in diameters."""
    at_truth = pair.problem().evaluate(pair.i_from_j)
    found = search_quickly(pair.problem())
    result = replace(found, kind=PairKind.GOOD, alternatives=(at_truth,), margin=1.0)
    least = LEAST * pair.diameter
    return silhouette_margin({(0, 1): result}, pair.fields, pair.diameter, least) / pair.diameter


def test_whole_scans_have_exact_silhouettes_and_trimmed_ones_as_far_as_they_were_cut():
    assert margin_of(creature_pair(30)) == 0.0
    little, much = margin_of(trimmed_pair(0.1)), margin_of(trimmed_pair(0.25))
    assert 0.02 < little < much <= 1.001 * MAX_MARGIN_DIAMETERS


def test_within_the_margin_empty_pixels_are_mute_and_beyond_it_they_speak():
    pair = trimmed_pair(0.2)
    tolerance = LEAST * pair.diameter

    def free(margin: float, pose: Pose) -> float:
        i, j = (with_margin(field, margin * pair.diameter) for field in pair.fields)
        ((one, other),) = evidence_at_poses(i, j, [pose], tolerance)
        return mean_evidence(one, other).free

    at_truth = [free(margin, pair.i_from_j) for margin in (0.0, 0.02, margin_of(pair), 0.3)]
    assert at_truth[0] > at_truth[1] > at_truth[2] >= at_truth[3] == 0.0
    assert at_truth[2] < 0.15 * at_truth[0]
    aside = Pose(rotation=np.eye(3), translation=np.array([0.4 * pair.diameter, 0.0, 0.0]))
    assert free(0.05, aside @ pair.i_from_j) > 0.1, "far outside, what is empty is empty"


def test_a_margin_changes_nothing_but_what_is_said_of_free_space():
    i, j = creature_pair(30).fields
    moved = with_margin(i, 0.05 * i.diameter)
    assert np.all(moved.raster[..., RASTER_OUTSIDE] <= i.raster[..., RASTER_OUTSIDE])
    np.testing.assert_array_equal(
        np.delete(moved.raster, RASTER_OUTSIDE, axis=2), np.delete(i.raster, RASTER_OUTSIDE, axis=2)
    )
    pose = creature_pair(30).i_from_j
    near, far = see(i, j, pose, i.diameter)[1], see(moved, j, pose, i.diameter)[1]
    np.testing.assert_array_equal(near.lands, far.lands)
    assert not np.any(far.in_free_space & ~near.in_free_space)


def test_certain_are_pairs_whose_surfaces_leave_no_doubt_whatever_free_space_says():
    pair = creature_pair(30)
    found = search_quickly(pair.problem())
    best = found.alternatives[0]
    told = best.evidence

    def is_certain(result: PairResult) -> bool:
        return certain_pairs([result]) == [result]

    def with_evidence(**changes: float) -> PairResult:
        changed = replace(best, evidence=replace(told, **changes))
        return replace(found, alternatives=(changed, *found.alternatives[1:]))

    assert is_certain(found)
    assert is_certain(replace(found, kind=PairKind.CONTRADICTED))
    assert is_certain(with_evidence(free=0.9, free_patch=0.5))
    assert not is_certain(with_evidence(front=0.2 * told.agree))
    assert not is_certain(with_evidence(agree=0.2))
    assert not is_certain(replace(found, margin=0.3))
    slides = replace(found, observability=1e-4)
    assert is_certain(slides), "it is good: it comes back from wherever it is pushed"
    assert not is_certain(replace(slides, kind=PairKind.SLIDING))


def test_a_ring_of_scans_cut_by_hand_is_put_together_and_says_so():
    """The half of each scan's border that was cut is no silhouette; the report tells."""
    scene = creature_scene(8, pixels=100)
    cut = [trimmed(scan, 0.12, 2.1 * k) for k, scan in enumerate(scene.scans)]
    found = run(cut, Config(fusion=FusionConfig(max_voxels_across=50)), workers=2)
    assert found.sensor is not None and found.sensor.margin > 0.02 * found.sensor.diameter
    assert "say nothing" in found.sensor.words()
    assert len(found.components) == 1 and len(found.poses) == 8
    names = [scan.name for scan in scene.scans]
    for a, b in pairwise(names):
        true = scene.i_from_j(names.index(a), names.index(b))
        assert (true.inverse() @ found.poses[a].inverse() @ found.poses[b]).angle_deg() < 3.0


@pytest.mark.parametrize(("count", "is_said"), [(MIN_SAYING, True), (MIN_SAYING - 1, False)])
def test_components_that_many_pairs_would_join_alike_are_said_to_have_moved(
    count: int, is_said: bool
):
    """Three and three scans; so many pairs across say one motion, the others another one each."""
    world = world_of(6)
    across = [(i, j) for i in range(3) for j in range(3, 6)]
    pairs = exact_pairs([(0, 1), (1, 2), (3, 4), (4, 5), *across[:count]], world)
    for n, (i, j) in enumerate(across[count:]):
        true = world[i].inverse() @ world[j]
        pose = true @ turn_about_centre(40.0 + 30.0 * n)
        pairs[i, j] = pair_of(i, j, PairKind.SLIDING, option(pose))
    halves = [
        Component(poses={k: world[k] for k in scans}, reference=scans[0])
        for scans in ((0, 1, 2), (3, 4, 5))
    ]
    told = why_apart(graph_with(pairs, *halves), [CENTRE] * 6, SAME)
    assert bool(told) is is_said
    if is_said:
        assert f"{count} pairs" in told[0] and "moved" in told[0]
