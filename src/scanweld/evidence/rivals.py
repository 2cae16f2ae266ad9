"""What other poses of the same scans count for beside the best one."""

from collections.abc import Sequence

RIVAL_ANGLE_DEG = 12.0
"""Two poses that differ by less than this are the same answer, not rivals,"""
RIVAL_SHIFT_DIAMETERS = 0.06
"""if they also put the middle of a scan to within this of each other."""
CLEAN_SHARE, VIOLATION_RATIO = 0.15, 1.3
"""A rival is contradicted no more than a pose if its violations, as a share of what agrees, are
within the first, or within so many times those of the pose."""
CLEAN_CONTRADICTION = 0.05
"""The same where violations are judged by their patches."""
MIN_RIVAL_SHARE = 0.35
"""Least agreement of such a rival, as a share of that of the pose: slivers fit in many ways."""


def margin_over(score: float, rivals: Sequence[float]) -> float:
    """Share of a score by which it beats its best rival: 1 without a rival, 0 if not positive."""
    if score <= 0:
        return 0.0
    return min(1.0, (score - max(rivals)) / score) if rivals else 1.0


def as_rival(
    score: float,
    agree: tuple[float, float],
    violated: tuple[float, float],
    clean: float = CLEAN_SHARE,
) -> float:
    """What a place scores as a rival of the best one.

    A rival that is contradicted no more explains the scans as well, if they overlap less in it:
    on a symmetric object the next turn does. It counts as if it overlapped as much.

    Args:
        score: Of the rival by itself.
        agree: What agrees, in the rival and in the best place.
        violated: Violations as a share of that, likewise.
        clean: Of which so much is none.
    """
    bearable = max(clean, VIOLATION_RATIO * violated[1])
    if agree[0] <= MIN_RIVAL_SHARE * agree[1] or violated[0] > bearable:
        return score
    return score * max(1.0, agree[1] / agree[0])


def refutation(violated: Sequence[float]) -> float:
    """How clearly the least contradicted rival of a pose is refuted.

    Args:
        violated: Violations of each rival, as a share of what agrees.

    Returns:
        That share for the best rival, at most 1: that of a pose without rivals.
    """
    return min([1.0, *violated])
