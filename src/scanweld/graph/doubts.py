"""What speaks against the pose of a placed scan: a code for programs, and words for people."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class DoubtCode(StrEnum):
    """Kinds of doubts, what says most about a scan first. Codes are published: none may change."""

    CAMERA_STOOD = "camera_stood"
    ALONE = "alone"
    MOVED_PART = "moved_part"
    VIOLATED = "violated"
    INSIDE = "inside"
    UNPAIRED = "unpaired"
    MARK_ONLY = "mark_only"
    NOT_REFINED = "not_refined"
    DISAGREEMENT = "disagreement"
    OFF_AXIS = "off_axis"
    SCALE = "scale"
    INEXACT = "inexact"
    CONFIDENCE = "confidence"


_RANK = {code: rank for rank, code in enumerate(DoubtCode)}


@dataclass(frozen=True, slots=True)
class Doubt:
    """One thing that speaks against a scan's pose.

    Attributes:
        code: Its kind.
        text: In words.
    """

    code: DoubtCode
    text: str


Doubts = Mapping[int, tuple[Doubt, ...]]
"""Of scans by index: what says most comes first, and no list is empty."""


def doubt_of(code: DoubtCode, texts: Mapping[int, str]) -> dict[int, tuple[Doubt, ...]]:
    """One doubt about each of some scans."""
    return {k: (Doubt(code, text),) for k, text in texts.items()}


def merged(*parts: Doubts) -> dict[int, tuple[Doubt, ...]]:
    """All doubts together, of each scan one of a kind: the first that is given."""
    found: dict[int, dict[DoubtCode, Doubt]] = {}
    for part in parts:
        for k, doubts in part.items():
            for doubt in doubts:
                found.setdefault(k, {}).setdefault(doubt.code, doubt)
    return {
        k: tuple(sorted(kinds.values(), key=lambda doubt: _RANK[doubt.code]))
        for k, kinds in found.items()
    }
