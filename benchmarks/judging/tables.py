"""Tables of the runs, in Markdown."""

from collections.abc import Callable, Sequence
from statistics import median

from benchmarks.blocks import markdown_table
from benchmarks.judging.floors import Floor, determined, posed_pairs, scans_of, share
from benchmarks.judging.trial import CRASH, ERROR, Outcome, ScanOutcome
from benchmarks.scores import Stated, bound
from benchmarks.virtual.scene import Group
from scanweld.pairs.result import PairKind
from scanweld.reconstruction import ScanVerdict

MAX_MISSES = 80


def floor_table(floors: Sequence[Floor]) -> str:
    """Floors beside what is reached."""
    words = {True: "PASS", False: "**FAIL**", None: "-"}
    rows = [(f.measure, f.asked, f.reached, words[f.is_met]) for f in floors]
    return markdown_table(("measure", "floor", "measured", ""), rows)


def scenario_table(outcomes: Sequence[Outcome]) -> str:
    """A line a scenario."""
    headings = (
        *("scenario", "asked", "runs", "scans", "right %", "good and right %", "falsely good"),
        *("doubtful", "of these wrong", "unplaced", "apart", "strangers good", "verdicts", "CPU s"),
    )
    names = dict.fromkeys(outcome.scenario for outcome in outcomes)
    rows = [_scenario(name, [o for o in outcomes if o.scenario == name]) for name in names]
    return markdown_table(headings, rows)


def kind_table(outcomes: Sequence[Outcome]) -> str:
    """What two scans alone say, and how often they are right; pairs without a pose left out."""
    rows = []
    for kind in PairKind:
        of = [pair for pair in posed_pairs(outcomes) if pair.kind is kind]
        accepted = [pair for pair in of if pair.is_accepted]
        wrong = sum(not pair.is_right for pair in accepted)
        num_runs = sum(
            any(p and p.is_accepted and p.kind is kind for p in o.pairs) for o in outcomes
        )
        rows.append(
            (
                *(str(kind), len(of), sum(pair.is_right for pair in of), len(accepted)),
                *(_bounded(wrong, num_runs), sum(pair.is_open for pair in of)),
            )
        )
    headings = ("kind", "pairs", "right", "accepted", "accepted wrong", "of symmetric objects")
    return markdown_table(headings, rows)


def confidence_table(stated: dict[str, Stated]) -> str:
    """How good the confidences are."""
    rows = []
    for name, each in stated.items():
        area = f"{each.auc:.4f}" if 0 < each.num_right < len(each) else "- (none wrong)"
        errors = f"{each.calibration_error():.4f}", f"{each.brier:.4f}"
        rows.append((name, len(each), each.num_right, area, *errors))
    headings = ("confidence of", "number", "right", "AUC", "calibration error", "Brier score")
    return markdown_table(headings, rows)


def misses(outcomes: Sequence[Outcome]) -> str:
    """A line for every falsely good scan, every failure, and every run with scans missing."""
    lines = []
    for outcome in outcomes:
        head = f"- {outcome.scenario}, seed {outcome.seed}: "
        if outcome.verdict in (CRASH, ERROR):
            lines.append(f"{head}**{outcome.verdict}**, {outcome.reason.strip().splitlines()[-1]}")
        lines += [
            f"{head}**falsely good**, scan {_told(scan)}"
            for scan in outcome.scans
            if scan.is_good and scan.is_false
        ]
        asked = determined([outcome])
        missing = [scan for scan in asked if not scan.is_right]
        if missing and outcome.group not in (Group.SYMMETRIC, Group.REPORTED):
            lines.append(
                f"{head}{len(missing)} of {len(asked)} not right, such as scan {_told(missing[0])}"
            )
    if len(lines) > MAX_MISSES:
        lines[MAX_MISSES:] = [f"- and {len(lines) - MAX_MISSES} more"]
    return "\n".join(lines or ["None."]) + "\n"


def _scenario(name: str, runs: Sequence[Outcome]) -> tuple[object, ...]:
    scans, belonging = scans_of(runs), determined(runs)
    doubtful = [scan for scan in scans if scan.verdict == ScanVerdict.DOUBTFUL]
    strangers = [scan for scan in scans if scan.is_stranger]
    false, good_strangers = (
        sum(s.is_good and holds for s, holds in some)
        for some in ([(s, s.is_false) for s in scans], [(s, True) for s in strangers])
    )
    verdicts = [run.verdict for run in runs]
    return (
        *(name, runs[0].group, len(runs), len(scans)),
        _percent(belonging, lambda scan: scan.is_right),
        _percent(belonging, lambda scan: scan.is_right and scan.is_good),
        f"**{false}**" if false else "0",
        *(len(doubtful), sum(scan.is_false for scan in doubtful)),
        sum(not scan.is_placed for scan in belonging),
        sum(scan.is_apart for scan in belonging),
        f"{good_strangers}/{len(strangers)}" if strangers else "",
        ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts)),
        f"{median(run.seconds for run in runs):.0f}",
    )


def _bounded(count: int, num_runs: int) -> str:
    return str(count) if count or not num_runs else f"0 ({bound(num_runs)})"


def _percent(scans: Sequence[ScanOutcome], holds: Callable[[ScanOutcome], bool]) -> str:
    return f"{100 * share(scans, holds):.0f}" if scans else ""


def _told(scan: ScanOutcome) -> str:
    error = ""
    if scan.rotation_deg is not None and scan.translation_percent is not None:
        error = f" by {scan.rotation_deg:.1f} deg and {scan.translation_percent:.1f} %"
    apart = ", apart from the others" if scan.is_apart else ""
    told = f"{scan.source} ({scan.verdict}, {scan.standing}{error}{apart})"
    return f"{told}: {scan.reason}" if scan.reason else told
