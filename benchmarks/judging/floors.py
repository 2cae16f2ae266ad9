"""What the runs must show, beside what they show."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.judging.measures import calibration_error
from benchmarks.judging.trial import CRASH, Outcome, PairOutcome, ScanOutcome
from benchmarks.paper.success import auc
from benchmarks.sets import SETS
from benchmarks.sets import Floors as SetFloors
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import Group
from scanweld.reconstruction import Verdict

MIN_CLEAN, MIN_HARD, MIN_CROP = 0.97, 0.90, 0.80
MIN_AUC, MAX_CALIBRATION_ERROR = 0.99, 0.05
ASSERTED = 0.5
"""A pose with more confidence is asserted."""
FACTOR_SLACK = 0.004
"""A factor that is named is this near to the true one."""
_NUMBER = re.compile(r"(\d+\.\d+)(\s*%)?")


@dataclass(frozen=True, kw_only=True, slots=True)
class Floor:
    """What is measured, what must be reached, what is reached; None where it is not judged."""

    measure: str
    asked: str
    reached: str
    is_met: bool | None


def floors(outcomes: Sequence[Outcome]) -> list[Floor]:
    """All floors but those of the real sets."""
    scans = scans_of(outcomes)
    good = [scan for scan in scans if scan.is_good]
    false = sum(scan.is_false for scan in good)
    strangers = [scan for scan in scans if scan.world is None]
    good_strangers = sum(scan.is_good for scan in strangers)
    return [
        Floor(
            measure="scans called good that are wrong, or whose pose nothing determines",
            asked="0",
            reached=f"{false} of {len(good)} good scans, {len(scans)} in all",
            is_met=false == 0,
        ),
        _asserted(outcomes),
        Floor(
            measure="scans of another object, of noise, mirrored: called good",
            asked="0",
            reached=f"{good_strangers} of {len(strangers)}",
            is_met=good_strangers == 0,
        ),
        _clean(outcomes),
        _worst(outcomes, Group.HARD, MIN_HARD, "each hard condition alone"),
        _worst(outcomes, Group.CROP, MIN_CROP, "each crop alone"),
        _scale(outcomes),
        *_confidence(outcomes),
        _ended(outcomes),
    ]


def real_sets(runs: Sequence[Mapping[str, Any]]) -> Floor:
    """The records of ``benchmarks/run.py``, against the floors of its sets."""
    met = [_is_met(run, SETS[run["set"]].floors) for run in runs]
    good = sum(run["verdict"] == Verdict.GOOD for run in runs)
    return Floor(
        measure="the real sets: at their floors, verdict good",
        asked="all",
        reached=f"{sum(met)} of {len(runs)} at their floors, {good} good",
        is_met=all(met) and good == len(runs),
    )


def _is_met(run: Mapping[str, Any], asked: SetFloors) -> bool:
    limits = {k: v for k, v in asdict(asked).items() if k != "right" and v is not None}
    return (
        run["right"] >= asked.right
        and run["wrong"] == 0
        and all(run[key] is not None and run[key] <= limit for key, limit in limits.items())
    )


def scans_of(outcomes: Sequence[Outcome]) -> list[ScanOutcome]:
    """All scans of all runs."""
    return [scan for outcome in outcomes for scan in outcome.scans]


def posed_pairs(outcomes: Sequence[Outcome]) -> list[PairOutcome]:
    """All pairs of all runs that have a pose."""
    return [pair for outcome in outcomes for pair in outcome.pairs if pair is not None]


def determined(outcomes: Sequence[Outcome]) -> list[ScanOutcome]:
    """The scans that belong and whose pose is determined by what they show."""
    return [scan for scan in scans_of(outcomes) if scan.world is not None and not scan.is_open]


def share(scans: Sequence[ScanOutcome], holds: Callable[[ScanOutcome], bool]) -> float:
    """Share of scans of which something holds; NaN of none."""
    return float(np.mean([holds(scan) for scan in scans])) if scans else float("nan")


def names_factor(scan: ScanOutcome) -> bool:
    """Whether the report says by which factor a scan's scale is wrong."""
    told = [(float(number), bool(percent)) for number, percent in _NUMBER.findall(scan.reason)]
    factors = [1.0 + number / 100.0 if is_percent else number for number, is_percent in told]
    true = (scan.factor, 1.0 / scan.factor)
    return "scale" in scan.reason and any(abs(f - t) < FACTOR_SLACK for f in factors for t in true)


def _ended(outcomes: Sequence[Outcome]) -> Floor:
    crashes = sum(outcome.verdict == CRASH for outcome in outcomes)
    return Floor(
        measure="runs that crash",
        asked="0",
        reached=f"{crashes} of {len(outcomes)}",
        is_met=crashes == 0,
    )


def _asserted(outcomes: Sequence[Outcome]) -> Floor:
    """Poses that are asserted although several explain what the scans show."""
    open_scans = [s for s in scans_of(outcomes) if s.is_open]
    open_pairs = [p for p in posed_pairs(outcomes) if p.is_open]
    asserted = [
        sum((each.confidence or 0.0) > ASSERTED for each in some)
        for some in (open_scans, open_pairs)
    ]
    return Floor(
        measure="symmetric and sliding objects: pose asserted with confidence > 0.5",
        asked="0",
        reached=f"{asserted[0]} of {len(open_scans)} scans, "
        f"{asserted[1]} of {len(open_pairs)} pairs",
        is_met=sum(asserted) == 0 if open_scans else None,
    )


def _clean(outcomes: Sequence[Outcome]) -> Floor:
    scans = determined([o for o in outcomes if group_of(o) is Group.CLEAN])
    reached = share(scans, lambda scan: scan.is_good and scan.is_right)
    return Floor(
        measure="clean scenarios: scans called good and right",
        asked=f">= {100 * MIN_CLEAN:g} %",
        reached=f"{100 * reached:.1f} % of {len(scans)}",
        is_met=reached >= MIN_CLEAN if scans else None,
    )


def _worst(outcomes: Sequence[Outcome], group: Group, floor: float, told: str) -> Floor:
    """The scenario of a group with the fewest right scans of those that belong."""
    shares = {
        name: share(determined([o for o in outcomes if o.scenario == name]), lambda s: s.is_right)
        for name in dict.fromkeys(o.scenario for o in outcomes if group_of(o) is group)
    }
    missed = [name for name in shares if not shares[name] >= floor]
    worst = min(shares, key=lambda name: shares[name], default="none")
    reached = f"least: {worst}, {100 * shares[worst]:.0f} %" if shares else "not measured"
    if missed:
        reached += f"; {len(missed)} of {len(shares)} below"
    return Floor(
        measure=f"{told}: right, of the scans that belong",
        asked=f">= {100 * floor:g} %",
        reached=reached,
        is_met=not missed if shares else None,
    )


def _scale(outcomes: Sequence[Outcome]) -> Floor:
    scaled = [scan for scan in scans_of(outcomes) if scan.factor != 1.0]
    good = sum(scan.is_good for scan in scaled)
    named = sum(names_factor(scan) for scan in scaled)
    return Floor(
        measure="a scan whose scale is wrong by 1 %: doubtful or refused, with the factor",
        asked="all",
        reached=f"{len(scaled) - good} of {len(scaled)}, with the factor {named}",
        is_met=not good and named == len(scaled) if scaled else None,
    )


def _confidence(outcomes: Sequence[Outcome]) -> list[Floor]:
    pairs = posed_pairs(outcomes)
    confidences, is_right = [p.confidence for p in pairs], [p.is_right for p in pairs]
    area = auc(confidences, is_right)
    error = calibration_error(confidences, is_right)
    return [
        Floor(
            measure="confidence of pairs, right against wrong: AUC",
            asked=f">= {MIN_AUC:g}",
            reached=f"{area:.4f} of {len(pairs)} pairs, {sum(is_right)} right",
            is_met=area >= MIN_AUC if pairs else None,
        ),
        Floor(
            measure="the same: expected calibration error",
            asked=f"<= {MAX_CALIBRATION_ERROR:g}",
            reached=f"{error:.4f}",
            is_met=error <= MAX_CALIBRATION_ERROR if pairs else None,
        ),
    ]


def group_of(outcome: Outcome) -> Group:
    """What is asked of a run's scenario."""
    return SCENARIOS[outcome.scenario].group
