"""What became of a run, of its scans and of its pairs, and how that stands in JSON.

A scan is *right* if its pose lies within 3 degrees and 1.5 % of the object's diameter of the truth
in the largest component that has scans of its world; within 5 degrees and 4 % where the sensor's
own error moves the best pose. It is *falsely good* if it is called good but
is not right, or if nothing that it shows determines its pose; it is *inexact* if it is nevertheless
the same answer, within 12 degrees and 6 %, nearer than any rival. A pair is right if its pose lies
within 5 degrees and 3 % (or 4 %, likewise), and is determined.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

from benchmarks.scores import Stated
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import Group
from scanweld.evaluation.metrics import Standing
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.pairs.result import PairKind
from scanweld.reconstruction import ScanVerdict

CRASH, ERROR = "crash", "error"


class ScanOutcome(NamedTuple):
    """What became of a scan; by default it is not placed."""

    source: str  # What it was made from, in words
    world: int | None  # Number of its world; None if it belongs nowhere
    is_open: bool  # Whether nothing that it shows determines its pose
    factor: float  # By which it is too large
    verdict: str = str(ScanVerdict.UNPLACED)  # Good, doubtful or unplaced
    standing: str = str(Standing.UNPLACED)  # Right, wrong or unplaced
    is_apart: bool = False  # Whether it lies in another component than most of its world
    confidence: float | None = None  # That its pose is right, as the report says
    rotation_deg: float | None = None  # Error of its pose; None where there is none
    translation_percent: float | None = None  # The same, in percent of the object's diameter
    reason: str = ""  # What the report says of it, where it is not both good and right
    rotation_bound_deg: float | None = None  # That its error keeps within, at 95 %
    translation_bound_percent: float | None = None  # The same, in percent of the diameter

    @property
    def is_bounded(self) -> bool:
        """Whether its error keeps within the bounds that are stated."""
        errors = self.rotation_deg, self.translation_percent
        bounds = self.rotation_bound_deg, self.translation_bound_percent
        pairs = zip(errors, bounds, strict=True)
        return all(e is not None and b is not None and e <= b for e, b in pairs)

    @property
    def is_right(self) -> bool:
        """Whether it lies where it belongs, with the others."""
        return self.standing == Standing.RIGHT and not self.is_apart

    @property
    def is_good(self) -> bool:
        """Whether it is called good."""
        return self.verdict == ScanVerdict.GOOD

    @property
    def is_doubtful(self) -> bool:
        """Whether it is called doubtful."""
        return self.verdict == ScanVerdict.DOUBTFUL

    @property
    def is_placed(self) -> bool:
        """Whether it has a pose."""
        return self.standing != Standing.UNPLACED

    @property
    def is_false(self) -> bool:
        """Whether it is placed although it is wrong, or although its pose is open."""
        return self.standing == Standing.WRONG or (self.is_open and self.is_placed)

    @property
    def is_inexact(self) -> bool:
        """Whether it is wrong by more than is allowed, and yet the same answer: no other basin."""
        if self.is_open or self.rotation_deg is None or self.translation_percent is None:
            return False
        is_near = self.translation_percent <= 100.0 * RIVAL_SHIFT_DIAMETERS
        return self.is_false and is_near and self.rotation_deg <= RIVAL_ANGLE_DEG

    @property
    def is_stranger(self) -> bool:
        """Whether it belongs nowhere."""
        return self.world is None

    @property
    def is_determined(self) -> bool:
        """Whether it belongs, and what it shows determines its pose."""
        return not self.is_stranger and not self.is_open


class PairOutcome(NamedTuple):
    """What became of a pair that has a pose."""

    confidence: float  # That its pose is right, as the report says
    kind: PairKind  # What the two scans alone say
    is_accepted: bool  # Whether the view graph uses it
    is_right: bool  # Whether its pose is right
    is_open: bool  # Whether nothing that the two show determines it

    def brief(self) -> list[Any]:
        """For JSON: thousands of these stand in it."""
        return [round(self.confidence, 4), self.kind[0], *map(int, self[2:])]

    @classmethod
    def of(cls, values: list[Any]) -> Self:
        """From ``brief``."""
        confidence, initial, *flags = values
        kind = next(kind for kind in PairKind if kind.startswith(initial))
        return cls(confidence, kind, *map(bool, flags))


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """A run: its verdict in a word, its scans, its pairs in order (None: no pose), CPU seconds."""

    scenario: str
    seed: int
    verdict: str
    scans: tuple[ScanOutcome, ...]
    pairs: tuple[PairOutcome | None, ...]
    seconds: float
    reason: str = ""

    @property
    def group(self) -> Group:
        """What is asked of its scenario."""
        return SCENARIOS[self.scenario].group

    def record(self) -> dict[str, Any]:
        """For JSON, without the scenario and the seed."""
        brief = [[float(f"{v:.3g}") if isinstance(v, float) else v for v in s] for s in self.scans]
        pairs = [pair and pair.brief() for pair in self.pairs]
        told = {"verdict": self.verdict, "seconds": self.seconds, "reason": self.reason}
        return {**told, "scans": brief, "pairs": pairs}

    @classmethod
    def of(cls, unit: Mapping[str, Any], record: Mapping[str, Any]) -> Self:
        """From a record."""
        scans = tuple(ScanOutcome(*values) for values in record["scans"])
        pairs = tuple(values and PairOutcome.of(values) for values in record["pairs"])
        return cls(**{**unit, **record, "scans": scans, "pairs": pairs})


def scans_of(outcomes: Iterable[Outcome]) -> list[ScanOutcome]:
    """All scans of all runs."""
    return [scan for outcome in outcomes for scan in outcome.scans]


def posed_pairs(outcomes: Iterable[Outcome]) -> list[PairOutcome]:
    """All pairs of all runs that have a pose."""
    return [pair for outcome in outcomes for pair in outcome.pairs if pair is not None]


def determined(outcomes: Iterable[Outcome]) -> list[ScanOutcome]:
    """The scans that belong and whose pose is determined by what they show."""
    return [scan for scan in scans_of(outcomes) if scan.is_determined]


def share(things: Sequence[ScanOutcome | PairOutcome], *names: str) -> float:
    """Share of things of which all that is named holds; NaN of none."""
    holds = [all(getattr(thing, name) for name in names) for thing in things]
    return sum(holds) / len(holds) if holds else float("nan")


def stated_pairs(outcomes: Iterable[Outcome]) -> Stated:
    """Confidences of all pairs that have a pose."""
    return Stated.of((pair.confidence, pair.is_right) for pair in posed_pairs(outcomes))


def stated_scans(outcomes: Iterable[Outcome]) -> Stated:
    """Confidences of all placed scans: whether they are right beside others of their component."""
    return Stated.of(
        (scan.confidence, not scan.is_false)
        for scan in scans_of(outcomes)
        if scan.confidence is not None and scan.is_placed
    )
