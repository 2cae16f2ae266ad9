"""Poses that noise makes look free: pushed, they come back or they slide."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest

from scanweld.config import PairsConfig
from scanweld.evaluation.primitives import cylinder, sphere
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evidence.icp import MIN_MATCHES
from scanweld.evidence.information import information_from, observability_of
from scanweld.evidence.slippage import free_motions
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.result import Alternative, PairKind
from scanweld.pairs.stability import PERTURBATION_DIAMETERS, is_stable
from scanweld.pairs.verdict import result_of
from tests.bodies import lathed, seen_twice, vase
from tests.prepared import PreparedPair, creature_pair
from tests.scenes import small_creature
from tests.view_graphs import seen

CONFIG = PairsConfig()
DIAMETER = 2.0
POINTS = np.random.default_rng(0).uniform(-1, 1, size=(200, 3)) + np.array([0.0, 0.0, 5.0])
ONE_FREE = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
TWO_FREE = np.diag([1.0, 0.0, 1.0, 1.0, 1.0, 0.0])
BEST = Alternative(i_from_j=Pose.exp([0.3, -0.1, 0.2, 1.0, 2.0, 3.0]), evidence=seen(0.5))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class DrawnProblem(PairProblem):
    """Two scans that an ICP refines as it is drawn."""

    drawn: Callable[[Sequence[Pose]], list[Alternative]]

    @property
    def diameter(self) -> float:
        return DIAMETER

    def refine(self, poses: Sequence[Pose]) -> list[Alternative]:
        return self.drawn(poses)


def drawn_problem(refine: Callable[[Sequence[Pose]], list[Alternative]]) -> DrawnProblem:
    i, j = creature_pair(40.0).fields
    return DrawnProblem(edge=(0, 1), i=i, j=j, config=CONFIG, drawn=refine)


def held(information: FloatArray, ends: Sequence[tuple[float, float]]) -> bool:
    """Whether a pose is held, if of each push some share is left and the scans agree on so much."""
    pushed = []

    def refine(poses: Sequence[Pose]) -> list[Alternative]:
        here = ends[len(pushed) : len(pushed) + len(poses)]
        pushed.extend(poses)
        motions = [pose @ BEST.i_from_j.inverse() for pose in poses]
        return [
            Alternative(i_from_j=part_of(motion, left) @ BEST.i_from_j, evidence=seen(agree))
            for motion, (left, agree) in zip(motions, here, strict=True)
        ]

    found = is_stable(drawn_problem(refine), BEST, information, POINTS)
    for pose in pushed:
        moved = (pose @ BEST.i_from_j.inverse()).apply(POINTS) - POINTS
        assert 0.02 < np.sqrt((moved**2).sum(axis=1).mean()) / DIAMETER < 3 * PERTURBATION_DIAMETERS
    return found


def part_of(motion: Pose, share: float) -> Pose:
    """A motion that takes the middle of the points, and turns, by a share of what another does."""
    middle = Pose(rotation=np.eye(3), translation=POINTS.mean(axis=0))
    return middle @ Pose.exp(share * (middle.inverse() @ motion @ middle).log()) @ middle.inverse()


@pytest.mark.parametrize(
    ("ends", "is_held"),
    [
        ([(0.0, 0.5), (0.0, 0.5)], True),
        ([(0.2, 0.5), (0.1, 0.5)], True),
        ([(1.0, 0.5), (1.0, 0.5)], False),
        ([(0.5, 0.5), (0.0, 0.5)], False),
        ([(0.0, 0.5), (2.0, 0.1)], True),
        ([(0.0, 0.5), (2.0, 0.4)], False),
        ([(2.0, 0.1), (2.0, 0.1)], False),
    ],
)
def test_a_pose_is_held_if_it_comes_back_and_fits_nowhere_else(
    ends: list[tuple[float, float]], is_held: bool
):
    assert held(ONE_FREE, ends) is is_held
    assert held(TWO_FREE, [*ends, (0.0, 0.5), (0.0, 0.5)]) is is_held
    assert held(TWO_FREE, [(0.0, 0.5), (0.0, 0.5), *ends]) is is_held


def test_few_matches_hold_nothing():
    few = POINTS[: MIN_MATCHES - 1]
    problem = drawn_problem(lambda poses: [BEST] * len(poses))
    assert not is_stable(problem, BEST, ONE_FREE, few)
    none = np.zeros((0, 3))
    assert not is_stable(problem, BEST, np.zeros((6, 6)), none)


BODIES = {"creature": small_creature, "sphere": sphere, "cylinder": cylinder}


@lru_cache
def noisy_pair(body: str, gap: float) -> PreparedPair:
    mesh = BODIES[body]() if body in BODIES else lathed(vase)
    noise = NoiseModel(depth_diameters=0.005)
    return seen_twice(mesh, gap, 15.0, noise, azimuth_deg=40, rolls_deg=(0, 70), pixels=140)


def pushed_back(pair: PreparedPair, information: FloatArray) -> bool:
    problem = pair.problem()
    best = problem.evaluate(pair.i_from_j)
    return is_stable(problem, best, information, problem.matches(pair.i_from_j)[0])


@pytest.mark.parametrize("body", ["sphere", "cylinder", "vase"])
@pytest.mark.parametrize("gap", [20.0, 50.0])
def test_what_truly_slides_stays_where_it_is_pushed(body: str, gap: float):
    pair = noisy_pair(body, gap)
    information, *_ = information_from([pair.problem().matches(pair.i_from_j)], pair.diameter)
    assert len(free_motions(information, CONFIG.min_observability)) > 0
    assert not pushed_back(pair, information)


@pytest.mark.parametrize("gap", [20.0, 50.0])
def test_a_figure_comes_back_along_any_motion(gap: float):
    """Even if nothing at all is known of what is free."""
    assert pushed_back(noisy_pair("creature", gap), np.zeros((6, 6)))


def test_a_held_pair_is_good_though_it_has_no_information():
    pair = noisy_pair("creature", 80.0)
    option = pair.problem().evaluate(pair.i_from_j)
    # As if noise had drowned all but the firmest direction.
    blind = CONFIG.model_copy(update={"min_observability": 0.5})
    result = result_of(pair.problem(blind), (option,))
    assert observability_of(result.information) < 0.5
    assert result.kind is PairKind.GOOD and result.sliding is None
    twice = (option, replace(option, i_from_j=pair.i_from_j @ Pose.exp([0.5, 0, 0, 0, 0, 0])))
    unsure = result_of(pair.problem(blind), twice)
    assert unsure.kind is PairKind.SLIDING and unsure.margin < CONFIG.min_margin
