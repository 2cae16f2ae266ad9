"""Two scans -> distinct relative poses with their evidence, from any start pose."""

from collections.abc import Sequence
from dataclasses import replace

from scanweld.evidence.icp import icp
from scanweld.evidence.visibility import pose_rows
from scanweld.geometry.pose import Pose
from scanweld.pairs.hypotheses import Anchors
from scanweld.pairs.polish import Polish, polished
from scanweld.pairs.problem import PairProblem, schedules, to_pose
from scanweld.pairs.result import Alternative, PairResult
from scanweld.pairs.revolution import turn_to_feature
from scanweld.pairs.search import search
from scanweld.pairs.symmetry_breaking import Decision, decide, ties
from scanweld.pairs.verdict import result_of


def register_pair(
    problem: PairProblem,
    anchors: Sequence[tuple[Anchors, Anchors]],
    polish: Polish | None = None,
    start: Pose | None = None,
) -> PairResult:
    """Find the poses that explain two scans best, coarse to fine, whatever their frames are.

    Args:
        problem: The two scans.
        anchors: Sets of anchors of i and j; all pairs within a set are tried.
        polish: Refines the best poses once more; what makes the evidence worse is not taken.
        start: A pose i_from_j to be tried besides, judged like those that are found.

    Returns:
        The result, with poses i_from_j between the sensor frames.
    """
    found = search(problem, anchors, problem.config.num_survivors)
    alternatives = ranked(found[: problem.config.num_alternatives])
    decision = _by_features(problem, ranked(found))
    if decision is not None:
        alternatives = _as_decided(problem, alternatives, decision)
    if polish is not None:
        alternatives = ranked(polished(problem, alternatives, polish))
        # Two that were distinct may have come to the same: an answer is no rival of itself.
        rows = pose_rows([option.i_from_j for option in alternatives])
        kept = problem.distinct(rows, problem.rival_tolerance, len(rows))
        alternatives = [alternatives[k] for k in kept]
    if start is not None:
        alternatives = with_start(problem, alternatives, from_start(problem, start, polish))
    rests_on_feature = decision is not None and decision.is_hidden_in_others
    result = result_of(problem, tuple(alternatives), rests_on_feature=rests_on_feature)
    if decision is not None:
        return replace(result, passed_over=_others(problem, decision.passed_over, alternatives))
    tied = ties(ranked(found), problem.config.min_margin)
    return replace(result, further_ties=_others(problem, tied, alternatives))


def ranked(alternatives: Sequence[Alternative]) -> list[Alternative]:
    """The alternatives, best scored first."""
    return sorted(alternatives, key=lambda alternative: -alternative.score)


def _others(
    problem: PairProblem, options: Sequence[Alternative], listed: Sequence[Alternative]
) -> tuple[Alternative, ...]:
    """Options that are the same answer as none of those listed already, best first."""
    left = [o for o in options if not any(problem.is_same(o, one) for one in listed)]
    return tuple(ranked(left))


def _by_features(problem: PairProblem, alternatives: Sequence[Alternative]) -> Decision | None:
    """What features that break a symmetry decide among poses that tie."""
    if not alternatives:
        return None
    turned = turn_to_feature(problem, alternatives[0].i_from_j)
    if turned is not None:
        alternatives = [problem.evaluate(turned), *alternatives]
    return decide(problem, alternatives)


def _as_decided(
    problem: PairProblem, alternatives: Sequence[Alternative], decision: Decision
) -> list[Alternative]:
    """The pose that a feature decides on first, then what never tied with it."""
    decided = (decision.pose, *decision.passed_over)
    others = [
        option
        for option in alternatives
        if not any(problem.is_same(option, one) for one in decided)
    ]
    return [decision.pose, *others]


def from_start(problem: PairProblem, start: Pose, polish: Polish | None) -> Alternative:
    """The best of a start pose, refined from near and from far: thin overlap may not pull right."""
    i, j, diameter = problem.i, problem.j, problem.diameter
    far, near = schedules(diameter)
    rows = pose_rows([start])
    tries = [rows, icp(i, j, rows, near, diameter)]
    tries.append(icp(i, j, icp(i, j, rows, far, diameter), near, diameter))
    options = ranked([problem.evaluate(to_pose(row)) for (row,) in tries])
    if polish is not None:
        options = polished(problem, options[:1], polish)
    return replace(options[0], is_given=True)


def with_start(
    problem: PairProblem, alternatives: Sequence[Alternative], given: Alternative
) -> list[Alternative]:
    """The alternatives and a given one; where the search found it too, the better of the two."""
    same = [option for option in alternatives if problem.is_same(option, given)]
    if same and same[0].score >= given.score:
        return list(alternatives)
    others = [option for option in alternatives if option not in same]
    return ranked([*others, replace(given, is_given=not same)])
