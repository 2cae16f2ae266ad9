"""A quick search of a pair, and pairs whose pose is known: enough where two scans leave no doubt.

The sweep ranks so well that a quarter of the anchors and a few survivors find what overlaps by more
than a tenth. What is thinner, sliding or symmetric is left to the thorough search.
"""

from dataclasses import replace

from scanweld.config import PairsConfig
from scanweld.evidence.evidence import MIN_AGREE
from scanweld.geometry.pose import Pose
from scanweld.pairs.anchors import even_anchors
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.register import from_start, ranked, with_start
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pairs.search import search
from scanweld.pairs.verdict import no_pose, result_of

NUM_QUICK_ANCHORS = 16
"""Evenly spread points of the first scan that are laid onto ``num_anchors`` of the second."""
NUM_QUICK_SURVIVORS = 80, 16
"""Hypotheses that are refined, far and near."""
CLEAR_SCORE, CLEAR_MARGIN = 3.0, 1.25
"""So many times the score and the margin of a good pair make a clear one: fewer rivals were seen.
How often a clear pair is wrong: docs/performance.md."""
NO_OVERLAP = "the scans do not overlap where other pairs place them"


def search_quickly(problem: PairProblem, start: Pose | None = None) -> PairResult:
    """Poses of a pair from evenly spread anchors and few survivors, judged like any others.

    Args:
        problem: The two scans.
        start: A pose i_from_j to be tried besides.
    """
    config = problem.config
    anchors = (
        even_anchors(problem.i, NUM_QUICK_ANCHORS),
        even_anchors(problem.j, config.num_anchors),
    )
    found = ranked(search(problem, [anchors], NUM_QUICK_SURVIVORS)[: config.num_alternatives])
    if start is not None:
        found = with_start(problem, found, from_start(problem, start, None))
    return replace(result_of(problem, tuple(found)), is_searched=False)


def is_clear(result: PairResult, config: PairsConfig) -> bool:
    """Whether a quick search has settled a pair: good with so much to spare that it is believed."""
    best = result.best
    return (
        best is not None
        and result.kind is PairKind.GOOD
        and best.evidence.contradiction <= config.max_contradiction
        and best.score >= CLEAR_SCORE * config.min_score
        and result.margin >= CLEAR_MARGIN * config.min_margin
    )


def ask(problem: PairProblem, i_from_j: Pose, found: PairResult | None = None) -> PairResult:
    """The result of a pair at the pose that other pairs say, with what was found as its rivals.

    Where they hardly overlap there, what was found stays.

    Args:
        problem: The two scans.
        i_from_j: The pose, between the sensor frames.
        found: What a quick search found of the pair, if there was one.
    """
    asked = ranked([problem.evaluate(i_from_j), *problem.refine([i_from_j])])[0]
    if asked.evidence.agree < MIN_AGREE:
        return found or replace(no_pose(*problem.edge, NO_OVERLAP), is_searched=False)
    known = () if found is None else found.alternatives
    same = [option for option in known if problem.is_same(option, asked)]
    rivals = [option for option in known if option not in same]
    options = ranked([ranked([asked, *same])[0], *rivals])
    return replace(result_of(problem, tuple(options)), is_searched=False)
