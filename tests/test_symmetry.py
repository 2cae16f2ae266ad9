"""Ambiguity that is named: what rival poses have in common, and how much each of them counts."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from scanweld.config import PairsConfig
from scanweld.evaluation.primitives import lathe
from scanweld.evidence.evidence import VIOLATION_WEIGHT
from scanweld.evidence.slippage import Slide, Slippage
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.graph.reasons import why_open
from scanweld.pairs.result import Alternative, PairKind, PairResult, near_best, weights_of
from scanweld.pairs.symmetry import Likeness, Symmetry, symmetry_of
from tests.bodies import registered, seen_twice
from tests.scenes import MILD_NOISE, random_motion
from tests.view_graphs import graph_with, option, pair_of, seen

CONFIG = PairsConfig()
DIAMETER = 2.0
CENTRE = np.array([0.3, -0.2, 4.0])


def turns(axis: FloatArray, *degrees: float, point: FloatArray = CENTRE) -> list[Pose]:
    rotations = [rotation_exp(np.radians(a) * axis / np.linalg.norm(axis)) for a in degrees]
    return [Pose(rotation=r, translation=point - r @ point) for r in rotations]


def poses_by(motions: Sequence[Pose], seed: int = 0) -> list[Pose]:
    """A pose i_from_j and those that it becomes if the object is moved; each a little off."""
    rng = np.random.default_rng(seed)
    best = random_motion(rng, 3.0)
    middle = Pose(rotation=np.eye(3), translation=CENTRE)
    off = [
        middle @ Pose.exp(rng.normal(size=6) * ([0.006] * 3 + [0.006] * 3)) @ middle.inverse()
        for _ in motions
    ]
    rivals = [best @ g.inverse() @ o for g, o in zip(motions, off, strict=True)]
    return [best, *rivals]


def common(poses: Sequence[Pose], factor: float = 1.0) -> Symmetry | None:
    """Of poses that count alike, in a unit that is so many times smaller."""
    return symmetry_of(poses, [1.0] * len(poses), factor * CENTRE, factor * DIAMETER)


AXIS = np.array([1.0, 2.0, -0.5])
ACROSS = np.array([2.0, -1.0, 0.0])
ASIDE = np.array([0.0, 0.0, 1.0])
SEVERAL = "several unrelated poses"


ONE, OPEN = Likeness.ONE_AXIS, Likeness.UNRELATED
MOTIONS = [
    (turns(AXIS, 180), ONE, "a half turn about an axis"),
    (turns(AXIS, 72), ONE, "a turn by 72 deg about an axis"),
    (turns(AXIS, 120, -120), ONE, "a turn by 120 deg about an axis"),
    (turns(AXIS, 90, 180, -90), ONE, "turns by 90 deg about an axis, 4-fold"),
    (turns(AXIS, 30, -60, 150), ONE, "turns by 30 deg about an axis, 12-fold"),
    (turns(AXIS, 72, 144), ONE, "turns by 72 deg about an axis, 5-fold"),
    (turns(AXIS, 13, 29, -50, 71, 100), ONE, "any turn about an axis"),
    (
        [*turns(AXIS, 90, 180), *turns(ACROSS, 180), *turns(ASIDE, 90)],
        Likeness.ONE_POINT,
        "turns about several axes through one point",
    ),
    ([*turns(AXIS, 90), *turns(ACROSS, 90, point=CENTRE + ASIDE)], OPEN, SEVERAL),
    ([*turns(AXIS, 40), *turns(AXIS, 80, point=CENTRE + 0.5 * ACROSS)], OPEN, SEVERAL),
    ([Pose(rotation=np.eye(3), translation=np.array([0.3, 0.1, 0.0]))], OPEN, SEVERAL),
    # A screw: it turns about the axis and moves the middle along it.
    ([Pose(rotation=turns(AXIS, 60)[0].rotation, translation=0.4 * AXIS)], OPEN, SEVERAL),
]


@pytest.mark.parametrize(("motions", "likeness", "words"), MOTIONS)
def test_motions_are_named_in_any_unit(motions: list[Pose], likeness: Likeness, words: str):
    for seed in range(3):
        poses = poses_by(motions, seed)
        far = [Pose(rotation=p.rotation, translation=1000 * p.translation) for p in poses]
        for found in (common(poses), common(far, 1000.0)):
            assert found is not None
            assert (found.likeness, found.words) == (likeness, words)
            assert len(found.angles_deg) == (len(motions) if likeness is ONE else 0)


def test_one_pose_alone_has_nothing_in_common():
    assert common([]) is None
    assert common(poses_by([])) is None


def test_chance_does_not_hide_an_axis_unless_it_counts_most():
    poses = poses_by([*turns(AXIS, 60, 120), *turns(ACROSS, 77, 33)])
    few = symmetry_of(poses, [1.0, 0.8, 0.7, 0.5, 0.4], CENTRE, DIAMETER)
    assert few is not None and few.words == "turns by 60 deg about an axis, 6-fold"
    assert few.angles_deg == pytest.approx((60, 120), abs=2)
    many = symmetry_of(poses, [1.0, 0.5, 0.4, 0.8, 0.7], CENTRE, DIAMETER)
    assert many is not None and many.angles_deg != pytest.approx((60, 120), abs=2)


def alternative(score: float) -> Alternative:
    """Poses that all overlap as much, and differ by what lies before the surface."""
    evidence = replace(seen(0.9), front=(0.9 - score) / VIOLATION_WEIGHT)
    return Alternative(i_from_j=Pose.identity(), evidence=evidence)


def test_weights_fall_with_the_score_and_sum_to_one():
    options = [alternative(score) for score in (0.8, 0.8, 0.7, 0.48, 0.1, -0.4)]
    weights = weights_of(options, 0.4, 0.1)
    assert sum(weights) == pytest.approx(1.0)
    assert weights[0] == pytest.approx(weights[1])
    assert list(weights) == sorted(weights, reverse=True)
    # 0.48 is beaten by just the margin of 0.4.
    assert weights[3] / weights[0] == pytest.approx(np.exp(-2.0))
    assert weights[5] < 1e-2


def test_a_rival_that_nothing_contradicts_weighs_as_much_where_it_overlaps_less():
    weights = weights_of([alternative(0.89), option(Pose.identity(), 0.4)], 0.4, 0.1)
    assert weights == pytest.approx((0.5, 0.5), abs=0.05)


def test_weights_do_not_ask_whether_there_is_a_margin():
    assert weights_of([], 0.4, 0.1) == ()
    assert weights_of([alternative(-0.2)], 0.4, 0.1) == (1.0,)
    bad = weights_of([alternative(-0.1), alternative(-0.1)], 0.4, 0.1)
    assert bad == pytest.approx((0.5, 0.5))
    assert weights_of([alternative(0.5), alternative(0.4)], 0.0, 0.0) == (1.0, 0.0)


def test_rivals_are_what_the_best_does_not_beat_clearly():
    options = [alternative(score) for score in (0.8, 0.7, 0.49, 0.47)]
    assert near_best(options, 0.4) == options[:3]
    assert near_best(options, 0.1) == options[:2]
    assert near_best(options[:1], 0.4) == options[:1] and near_best([], 0.4) == []


@pytest.mark.parametrize("fold", [4, 12])
def test_a_gear_is_named_by_its_teeth(fold: int):
    mesh = lathe(lambda turn, level: 44.0 + 5.0 * np.tanh(4.0 * np.sin(fold * turn)), 25.0)
    view = {"azimuth_deg": 10, "rolls_deg": (0, 50), "pixels": 120}
    pair = seen_twice(mesh, 53, 40, MILD_NOISE, **view)
    result = registered(pair)
    assert result.kind is PairKind.AMBIGUOUS and result.symmetry is not None
    assert result.symmetry.words in result.reason
    step = 360 / fold
    steps = np.array(result.symmetry.angles_deg) / step
    assert len(steps) and (np.abs(steps - np.round(steps)) * step < 2.0).all()
    assert weights_of(result.alternatives, CONFIG.min_margin, CONFIG.min_score)[0] < 0.7
    # Turns that explain the scans as well are kept, even if they are more than usual.
    told = (*result.alternatives, *result.further_ties)
    angles = [(option.i_from_j.inverse() @ pair.i_from_j).angle_deg() for option in told]
    nearest = {round(a / step) for a in angles if abs(a - step * round(a / step)) < 2.0}
    assert len(nearest) >= fold // 2
    assert (len(told) > CONFIG.num_alternatives) or fold < CONFIG.num_alternatives


def pair_result(
    edge: tuple[int, int], symmetry: Symmetry | None = None, sliding: Slippage | None = None
) -> PairResult:
    kind = PairKind.GOOD if sliding is None else PairKind.SLIDING
    kind = kind if symmetry is None else PairKind.AMBIGUOUS
    pair = pair_of(*edge, kind, alternative(0.5))
    return replace(pair, symmetry=symmetry, sliding=sliding)


def words_of(results: Sequence[PairResult], unplaced: Sequence[int]) -> tuple[str, ...]:
    pairs = {(result.i, result.j): result for result in results}
    return why_open(graph_with(pairs, unplaced=dict.fromkeys(unplaced, "open")))


def one_axis(*angles: float) -> Symmetry:
    return Symmetry(likeness=Likeness.ONE_AXIS, angles_deg=angles)


def test_what_several_pairs_agree_on_is_said_once():
    symmetries = [one_axis(30.2), one_axis(60.1, 29.0), one_axis(90.5, 149.0), one_axis(31.0)]
    symmetries += [Symmetry(likeness=Likeness.UNRELATED), None]
    edges = combinations(range(4), 2)
    results = [pair_result(*each) for each in zip(edges, symmetries, strict=True)]
    assert words_of(results, range(4)) == (
        "the object looks alike after turns by 30 deg about an axis, 12-fold (4 pairs): "
        "poses are open",
    )
    assert words_of(results, []) == ()
    # Of the pairs of scan 3 only two are ambiguous, and these say different things.
    assert words_of([results[2], results[4]], [3]) == ()
    assert words_of(results[:1], range(4)) == ()
    (told,) = words_of([pair_result((0, k), one_axis(177.0 + k)) for k in (1, 2)], [0, 1, 2])
    assert told.startswith("the object looks alike after a half turn about an axis (2 pairs)")


def test_what_slides_is_said_once():
    vase = Slippage(slide=Slide.REVOLUTION, axis=np.eye(3)[2], point=np.zeros(3))
    several = Slippage(slide=Slide.MANY, axis=None, point=None)
    edges = list(combinations(range(3), 2))
    (told,) = words_of([pair_result(edge, sliding=vase) for edge in edges], [0, 1, 2])
    assert told.startswith("the scans slide on each other like a surface of revolution: free to")
    assert "(3 pairs)" in told
    assert words_of([pair_result(edge, sliding=several) for edge in edges], [0, 1, 2]) == ()
