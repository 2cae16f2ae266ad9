"""What the runs must show, beside what they show."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from benchmarks.judging import outcomes as judged
from benchmarks.judging.outcomes import Outcome, ScanOutcome, determined, share
from benchmarks.scores import bound
from benchmarks.sets import SETS
from benchmarks.virtual.scenarios import SCENARIOS
from benchmarks.virtual.scene import Group
from scanweld.reconstruction import Verdict

MIN_CLEAN, MIN_HARD, MIN_CROP = 0.97, 0.90, 0.80
MIN_AUC, MAX_CALIBRATION_ERROR = 0.99, 0.05
ASSERTED = 0.5
"""A pose with more confidence is asserted."""
FACTOR_SLACK = 0.004
"""A factor that is named is this near to the true one."""
NOT_MEASURED = "not measured"
BOUNDS_HOLD, MIN_GROUP_HOLDS = (0.93, 0.98), 0.90
"""Shares of the scans whose errors keep within bounds that are stated for 95 %."""
NO_ERROR_DEG = 1e-6
"""The scan that others are held against has no error."""
_NAMES_BODIES = re.compile(r"did not move|stood still|moved|more than one body|two bodies|cut: ")
_NUMBER = re.compile(r"(\d+\.\d+)(\s*%)?")


class Floor(NamedTuple):
    """What is measured, what must be reached, what is reached; None where it is not judged."""

    measure: str
    asked: str
    reached: str
    is_met: bool | None


def floors(outcomes: Sequence[Outcome]) -> list[Floor]:
    """All floors but those of the real sets."""
    scans = judged.scans_of(outcomes)
    good = [scan for scan in scans if scan.is_good]
    strangers = [scan for scan in scans if scan.is_stranger]
    return [
        _none(
            "scans called good in a wrong basin, or whose pose nothing determines",
            {
                f"of {len(good)} good scans, {len(scans)} in all": sum(
                    s.is_false and not s.is_inexact for s in good
                )
            },
            outcomes,
        ),
        _inexact([scan for scan in good if scan.is_inexact], outcomes),
        _asserted(outcomes),
        _none(
            "scans of another object, of noise, mirrored: called good",
            {f"of {len(strangers)}": sum(scan.is_good for scan in strangers)},
            [outcome for outcome in outcomes if any(s.is_stranger for s in outcome.scans)],
        ),
        _clean(determined(o for o in outcomes if o.group is Group.CLEAN)),
        _worst(outcomes, Group.HARD, MIN_HARD, "each hard condition alone"),
        _worst(outcomes, Group.CROP, MIN_CROP, "each crop alone"),
        *(
            _kept(name, scenario.min_kept, [o for o in outcomes if o.scenario == name])
            for name, scenario in SCENARIOS.items()
            if scenario.min_kept is not None
        ),
        _two_bodies([outcome for outcome in outcomes if outcome.group is Group.TWO_BODIES]),
        _accused([outcome for outcome in outcomes if outcome.group is Group.FILES]),
        _scaled([s for o in outcomes if o.group is Group.SCALE for s in o.scans if s.factor != 1]),
        *_confidence(outcomes),
        *_bounded(outcomes),
        _none(
            "runs that crash",
            {f"of {len(outcomes)}": sum(o.verdict == judged.CRASH for o in outcomes)},
            outcomes,
        ),
    ]


def real_sets(runs: Sequence[Mapping[str, Any]]) -> Floor:
    """The records of ``benchmarks.run``, against the floors of its sets."""
    met = sum(SETS[run["set"]].is_met(run) for run in runs)
    good = sum(run["verdict"] == Verdict.GOOD for run in runs)
    reached = f"{met} of {len(runs)} at their floors, {good} good"
    is_met = met == good == len(runs)
    return Floor("the real sets: at their floors, verdict good", "all", reached, is_met)


def names_factor(scan: ScanOutcome) -> bool:
    """Whether the report says by which factor a scan's scale is wrong."""
    told = [(float(number), bool(percent)) for number, percent in _NUMBER.findall(scan.reason)]
    factors = [1.0 + number / 100.0 if is_percent else number for number, is_percent in told]
    true = (scan.factor, 1.0 / scan.factor)
    return "scale" in scan.reason and any(abs(f - t) < FACTOR_SLACK for f in factors for t in true)


def is_accused(scan: ScanOutcome) -> bool:
    """Whether a scan is doubted or left out for its scale."""
    return not scan.is_good and "scale" in scan.reason


def names_bodies(outcome: Outcome) -> bool:
    """Whether a run says that not all of what its scans show moves as one body."""
    return _NAMES_BODIES.search(outcome.reason) is not None


def _none(measure: str, counts: Mapping[str, int], runs: Sequence[Outcome]) -> Floor:
    """Something that must not happen in any of these runs; beside a zero stands its bound."""
    told = ", ".join(f"{count} {of}" for of, count in counts.items())
    is_met = not any(counts.values())
    return Floor(measure, "0", told + (f" ({bound(len(runs))})" if is_met and runs else ""), is_met)


def _inexact(scans: Sequence[ScanOutcome], outcomes: Sequence[Outcome]) -> Floor:
    """Good scans that are the right answer, but farther off than their scenario allows."""
    beyond = sum(not scan.is_bounded for scan in scans)
    counts = {f"scans, {beyond} of them beyond the bounds that are stated": len(scans)}
    return _none("good scans in the right basin, but farther off than is allowed", counts, outcomes)


def _asserted(outcomes: Sequence[Outcome]) -> Floor:
    """Poses that are asserted although several explain what the scans show."""
    scans = [scan for scan in judged.scans_of(outcomes) if scan.is_open]
    pairs = [pair for pair in judged.posed_pairs(outcomes) if pair.is_open]
    counts = {
        f"of {len(some)} {name}": sum((each.confidence or 0.0) > ASSERTED for each in some)
        for name, some in (("scans", scans), ("pairs", pairs))
    }
    measure = f"symmetric and sliding objects: pose asserted with confidence > {ASSERTED:g}"
    found = _none(measure, counts, [o for o in outcomes if any(s.is_open for s in o.scans)])
    return found if scans else found._replace(is_met=None)


def _accused(outcomes: Sequence[Outcome]) -> Floor:
    """Scans without an error that somebody would now scale."""
    scans = judged.scans_of(outcomes)
    counts = {f"of {len(scans)} in {len(outcomes)} sets": sum(map(is_accused, scans))}
    floor = _none("files of all sorts: scans accused of a wrong scale", counts, outcomes)
    return floor if scans else floor._replace(reached=NOT_MEASURED, is_met=None)


def _kept(name: str, asked: float, outcomes: Sequence[Outcome]) -> Floor:
    """What is right and not doubted, where sensors and files are as bad as they are."""
    scans = determined(outcomes)
    reached = share(scans, "is_right", "is_good")
    measure, floor = f"{name}: scans that are right and called good", f">= {100 * asked:g} %"
    if not scans:
        return Floor(measure, floor, NOT_MEASURED, None)
    return Floor(measure, floor, f"{100 * reached:.1f} % of {len(scans)}", reached >= asked)


def _two_bodies(outcomes: Sequence[Outcome]) -> Floor:
    """Runs in which a part moves by itself, or the background stands still as the object turns."""
    # What was cut out of a standing room moves as one body, and may be good where it is right.
    good = sum(o.verdict == Verdict.GOOD and "cut: " not in o.reason for o in outcomes)
    named = sum(map(names_bodies, outcomes))
    measure = "not all moves as one body: called good; the reason names it"
    if not outcomes:
        return Floor(measure, "0; all", NOT_MEASURED, None)
    told = f"{good} of {len(outcomes)} good, the reason names it in {named}"
    return Floor(measure, "0; all", told, not good and named == len(outcomes))


def _bounded(outcomes: Sequence[Outcome]) -> list[Floor]:
    """Whether errors keep within the bounds that are stated, of right scans that have any."""
    held: dict[str, list[bool]] = {}
    for outcome in outcomes:
        for scan in outcome.scans:
            has_error = (scan.rotation_deg or 0.0) > NO_ERROR_DEG
            if scan.is_right and has_error and scan.rotation_bound_deg is not None:
                held.setdefault(str(outcome.group), []).append(scan.is_bounded)
    measure = "stated bounds of right scans hold"
    if not held:
        return [Floor(measure, "93 to 98 %", NOT_MEASURED, None)]
    every = [one for group in held.values() for one in group]
    reached = sum(every) / len(every)
    shares = {group: sum(some) / len(some) for group, some in held.items()}
    worst = min(shares, key=lambda group: shares[group])
    told = f"least: {worst}, {100 * shares[worst]:.0f} % of {len(held[worst])}"
    least, most = BOUNDS_HOLD
    return [
        Floor(
            measure,
            "93 to 98 %",
            f"{100 * reached:.1f} % of {len(every)}",
            least <= reached <= most,
        ),
        Floor(f"{measure}, each group", ">= 90 %", told, shares[worst] >= MIN_GROUP_HOLDS),
    ]


def _scaled(scans: Sequence[ScanOutcome]) -> Floor:
    not_good, named = sum(not s.is_good for s in scans), sum(map(names_factor, scans))
    measure = "a scan whose scale is wrong by 1 %: doubtful or refused, with the factor"
    is_met = not_good == named == len(scans) if scans else None
    return Floor(measure, "all", f"{not_good} of {len(scans)}, with the factor {named}", is_met)


def _clean(scans: Sequence[ScanOutcome]) -> Floor:
    reached, asked = share(scans, "is_good", "is_right"), f">= {100 * MIN_CLEAN:g} %"
    told, is_met = f"{100 * reached:.1f} % of {len(scans)}", reached >= MIN_CLEAN
    measure = "clean scenarios: scans called good and right"
    return Floor(measure, asked, told, is_met if scans else None)


def _worst(outcomes: Sequence[Outcome], group: Group, floor: float, told: str) -> Floor:
    """The scenario of a group with the fewest right scans of those that belong."""
    names = dict.fromkeys(o.scenario for o in outcomes if o.group is group)
    scans = {name: determined(o for o in outcomes if o.scenario == name) for name in names}
    shares = {name: share(some, "is_right") for name, some in scans.items()}
    missed = [name for name in shares if not shares[name] >= floor]
    worst = min(shares, key=lambda name: shares[name], default="none")
    reached = f"least: {worst}, {100 * shares[worst]:.0f} %" if shares else NOT_MEASURED
    if missed:
        reached += f"; {len(missed)} of {len(shares)} below"
    measure, is_met = f"{told}: right, of the scans that belong", not missed if shares else None
    return Floor(measure, f">= {100 * floor:g} %", reached, is_met)


def _confidence(outcomes: Sequence[Outcome]) -> list[Floor]:
    pairs = judged.stated_pairs(outcomes)
    area, error, is_any = pairs.auc, pairs.calibration_error(), len(pairs) > 0
    told = f"{area:.4f} of {len(pairs)} pairs, {pairs.num_right} right"
    auc, ece = "confidence of pairs, right against wrong: AUC", "expected calibration error"
    is_near = error <= MAX_CALIBRATION_ERROR if is_any else None
    return [
        Floor(auc, f">= {MIN_AUC:g}", told, area >= MIN_AUC if is_any else None),
        Floor(f"the same: {ece}", f"<= {MAX_CALIBRATION_ERROR:g}", f"{error:.4f}", is_near),
    ]
