"""Where a sensor looked past the object: a notch in its outline tells turns apart."""

from collections.abc import Sequence

import numpy as np
import pytest

from scanweld.evaluation.primitives import lathe
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.views import view_of
from scanweld.evidence.field import ScanField
from scanweld.evidence.patches import (
    MIN_FREE_SPACE_PIXELS,
    PixelConsensus,
    pixel_consensus,
    violates_free_space,
)
from scanweld.evidence.pixels import FREE_MARGIN_PIXELS, see
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.graph.merge import propose_merges, unrefuted
from scanweld.pairs.result import Alternative, PairKind
from tests.prepared import PreparedPair, creature_pair, prepared_pair
from tests.scenes import scene_of
from tests.view_graphs import SAME, DrawnJudge, pair_of, seen

TOLERANCE = 0.012
TURNS = (45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)


def gear(turn: FloatArray, level: FloatArray) -> FloatArray:
    return 44.0 + 6.0 * np.tanh(4.0 * np.cos(8 * turn)) + 0.0 * level


def toothless(turn: FloatArray, level: FloatArray) -> FloatArray:
    """The gear with its tooth at 0 gone from top to bottom."""
    is_gone = np.abs(np.angle(np.exp(1j * turn))) < np.pi / 10
    return np.where(is_gone, 38.0, gear(turn, level))


def from_both_sides(of_toothless: bool, noise: float) -> PreparedPair:
    """A scan from the tooth's side, and one from behind that sees it only in its outline."""
    mesh = lathe(toothless if of_toothless else gear, 30.0)
    views = [view_of(mesh, turn, 35.0, 20.0, pixels=200.0) for turn in (0.0, 180.0)]
    scene = scene_of(mesh, views, noise=NoiseModel(depth_diameters=noise, grazing_dropout=0.5))
    return prepared_pair(scene.scans[0], scene.scans[1], scene.i_from_j(0, 1))


def turned(pair: PreparedPair, degrees: float) -> Pose:
    """The true pose with j's object turned about its axis, that of the motion between the views."""
    motion = pair.i_from_j
    angles, vectors = np.linalg.eig(motion.rotation)
    axis = np.real(vectors[:, int(np.argmin(np.abs(angles - 1.0)))])
    point = np.linalg.lstsq(np.eye(3) - motion.rotation, motion.translation, rcond=1e-6)[0]
    turn = rotation_exp(np.radians(degrees) * axis)
    return motion @ Pose(rotation=turn, translation=point - turn @ point)


def told(pair: PreparedPair, i_from_j: Pose) -> list[PixelConsensus]:
    both = see(*pair.fields, i_from_j, pair.diameter)
    return [pixel_consensus([one], TOLERANCE * pair.diameter) for one in both]


@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_turns_that_fill_a_notch_in_the_outline_are_refuted(noise: float):
    pair = from_both_sides(of_toothless=True, noise=noise)
    right = told(pair, pair.i_from_j)
    for degrees in TURNS:
        wrong = told(pair, turned(pair, degrees))
        assert violates_free_space(wrong, right)
        assert not violates_free_space(right, wrong)


@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_no_turn_of_a_whole_gear_is_refuted(noise: float):
    pair = from_both_sides(of_toothless=False, noise=noise)
    every = [told(pair, turned(pair, degrees)) for degrees in (0.0, *TURNS)]
    assert not any(violates_free_space(a, b) for a in every for b in every)


def past(scan: ScanField, moved: Pose) -> int:
    """Pixels of a scan that is moved in its own sensor's frame where that sensor looked past."""
    back, _ = see(scan, scan, moved.inverse(), 1.0)
    return int(back.in_free_space.sum())


def sideways(scan: ScanField, pixels: float) -> Pose:
    shift = pixels * scan.centre[2] / scan.camera[1]
    return Pose(rotation=np.eye(3), translation=np.array([shift, 0.0, 0.0]))


def test_an_outline_a_pixel_off_is_not_looked_past():
    scan = creature_pair(40.0).fields[0]
    assert past(scan, Pose.identity()) == 0
    far = past(scan, sideways(scan, 12.0))
    assert far > 300
    assert past(scan, sideways(scan, FREE_MARGIN_PIXELS)) < 0.02 * far


def test_what_a_sensor_sees_the_back_of_is_not_looked_past():
    pair = creature_pair(40.0)
    scan, (x, _, z) = pair.fields[0], pair.fields[0].centre
    shift = sideways(scan, 12.0)
    about = rotation_exp(np.array([0.0, np.pi, 0.0]))
    turn = Pose(rotation=about, translation=np.array([2 * x, 0.0, 2 * z]))
    assert past(scan, shift @ turn) < 0.1 * past(scan, shift)


def merges_of(told_by_turn: Sequence[list[PixelConsensus]]) -> list[int]:
    """Which of equally scored turns of one scan about another are left, given what pixels say."""
    poses = [
        Pose(rotation=rotation_exp(np.array([0.0, 0.0, 0.5 * n])), translation=np.zeros(3))
        for n in range(len(told_by_turn))
    ]
    options = [Alternative(i_from_j=pose, evidence=seen(0.5)) for pose in poses]

    def turn_of(pose: Pose) -> int:
        return int(np.argmin([(pose.inverse() @ one).angle_deg() for one in poses]))

    judge = DrawnJudge(
        says=lambda i, j, pose: seen(0.5), sees=lambda a, b: told_by_turn[turn_of(b[1])]
    )
    a, b = {0: Pose.identity()}, {1: Pose.identity()}
    merges = propose_merges(
        a,
        b,
        {(0, 1): pair_of(0, 1, PairKind.AMBIGUOUS, *options)},
        [np.zeros(3)] * 2,
        SAME,
        judge,
    )
    return sorted(turn_of(merge.a_from_b) for merge in unrefuted(a, b, merges, judge))


def test_merges_that_sensors_look_past_are_no_rivals():
    pair = from_both_sides(of_toothless=True, noise=0.0)
    every = [told(pair, turned(pair, degrees)) for degrees in (0.0, *TURNS)]
    assert merges_of(every) == [0]


def says(*, violates: int = 0, past: range = range(0)) -> list[PixelConsensus]:
    """A scan of 400 pixels, of which the first are contradicted, and some looked past."""
    at = np.arange(400).reshape(20, 20)
    return [
        PixelConsensus(
            agrees=at >= violates,
            violates=at < violates,
            in_free_space=np.isin(at, past),
            max_pixels=200.0,
        )
    ]


def test_outlines_speak_only_where_surfaces_have_shown_a_mark():
    """What is missing from a scan of a symmetric object makes a notch in its outline as well."""
    holed, whole, worn = says(past=range(100)), says(), says(violates=40)
    assert merges_of([holed, whole, whole]) == [0, 1, 2]
    assert merges_of([holed, whole, worn, worn]) == [0, 1]
    assert merges_of([holed, whole, worn, worn, worn]) == [1]


def test_an_outline_decides_only_by_far():
    marked = [says(violates=40)] * 3
    least = MIN_FREE_SPACE_PIXELS
    assert merges_of([says(past=range(least - 1)), says(), *marked]) == [0, 1]
    assert merges_of([says(past=range(least)), says(), *marked]) == [1]
    much = says(past=range(100))
    assert merges_of([much, says(past=range(200, 240)), *marked]) == [0, 1]
    assert merges_of([much, says(past=range(200, 220)), *marked]) == [1]
