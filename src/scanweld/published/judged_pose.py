"""A pose that was found elsewhere, judged as strictly as the search judges its own answers."""

from dataclasses import replace

from scanweld.geometry.pose import Pose
from scanweld.pairs.anchors import even_anchors
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pairs.verdict import result_of


def judge_pose(problem: PairProblem, i_from_j: Pose) -> PairResult:
    """Classify a pair by one pose, whose rivals are looked for if it looks good.

    A pose that is alone has no rival and would look sure. So the search from any start is asked
    what else explains the scans. What it finds counts against the pose and is not taken over.

    Args:
        problem: The two scans.
        i_from_j: The pose between the sensor frames.
    """
    given = problem.evaluate(i_from_j)
    result = result_of(problem, (given,))
    if result.kind is not PairKind.GOOD:
        return result
    num_anchors = problem.config.num_anchors
    anchors = [(even_anchors(problem.i, num_anchors), even_anchors(problem.j, num_anchors))]
    found = register_pair(problem, anchors).alternatives
    rivals = [option for option in found if not problem.is_same(option, given)]
    return replace(result_of(problem, (given, *rivals)), alternatives=(given,))
