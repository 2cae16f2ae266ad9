"""Pairs that surfaces alone make certain: from these, a set tells of its sensor."""

from collections.abc import Iterable

from scanweld.pairs.result import PairKind, PairResult

Edge = tuple[int, int]

CERTAIN_AGREE, CERTAIN_VIOLATED = 0.25, 0.15
"""A certain pair agrees on so much; of that, so little lies before a surface or contradicts it."""
CERTAIN_MARGIN, CERTAIN_OBSERVABILITY = 0.4, 1e-3
"""It beats its rivals by this share, and slides nowhere."""
MAX_CERTAIN = 60
"""Pairs that are learnt from, the best first: more say the same."""


def certain_pairs(pairs: Iterable[PairResult]) -> list[PairResult]:
    """The pairs whose surfaces leave no doubt of them, whatever is said of free space, best first.

    Args:
        pairs: Of a run, judged.
    """
    return sorted(
        (pair for pair in pairs if _is_certain(pair)),
        key=lambda pair: (-pair.alternatives[0].score, pair.i, pair.j),
    )[:MAX_CERTAIN]


def _is_certain(pair: PairResult) -> bool:
    if pair.best is None:
        return False
    told = pair.best.evidence
    is_firm = pair.observability >= CERTAIN_OBSERVABILITY or pair.kind is PairKind.GOOD
    return (
        told.agree >= CERTAIN_AGREE
        and told.front + told.contradict <= CERTAIN_VIOLATED * told.agree
        and is_firm
        and pair.margin >= CERTAIN_MARGIN
    )
