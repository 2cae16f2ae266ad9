"""Tables of the runs, in Markdown."""

from collections.abc import Callable, Sequence
from statistics import median

from benchmarks.judging.floors import Floor, determined, group_of, posed_pairs, scans_of, share
from benchmarks.judging.trial import CRASH, ERROR, Outcome, ScanOutcome
from benchmarks.paper.pages import markdown_table
from benchmarks.virtual.scene import Group
from scanweld.evaluation.metrics import Standing
from scanweld.pairs.result import PairKind
from scanweld.reconstruction import ScanVerdict

HEADINGS = (
    *("scenario", "asked", "runs", "scans", "right %", "good and right %", "falsely good"),
    *("doubtful", "of these wrong", "unplaced", "apart", "strangers good", "verdicts", "CPU s"),
)
MAX_MISSES = 80


def floor_table(floors: Sequence[Floor]) -> str:
    """Floors beside what is reached."""
    words = {True: "PASS", False: "**FAIL**", None: "-"}
    rows = [(f.measure, f.asked, f.reached, words[f.is_met]) for f in floors]
    return markdown_table(("measure", "floor", "measured", ""), rows)


def scenario_table(outcomes: Sequence[Outcome]) -> str:
    """A line a scenario."""
    names = dict.fromkeys(outcome.scenario for outcome in outcomes)
    return markdown_table(
        HEADINGS, [_row(name, [o for o in outcomes if o.scenario == name]) for name in names]
    )


def kind_table(outcomes: Sequence[Outcome]) -> str:
    """What two scans alone say, and how often they are right; pairs without a pose left out."""
    pairs = posed_pairs(outcomes)
    rows = []
    for kind in PairKind:
        of = [pair for pair in pairs if pair.kind == kind]
        accepted = [pair for pair in of if pair.is_accepted]
        rows.append(
            (
                *(str(kind), str(len(of)), str(sum(pair.is_right for pair in of))),
                *(str(len(accepted)), str(sum(not pair.is_right for pair in accepted))),
                str(sum(pair.is_open for pair in of)),
            )
        )
    headings = ("kind", "pairs", "right", "accepted", "accepted wrong", "of symmetric objects")
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
        missing = [scan for scan in determined([outcome]) if not scan.is_right]
        if missing and group_of(outcome) not in (Group.SYMMETRIC, Group.REPORTED):
            lines.append(
                f"{head}{len(missing)} of {len(determined([outcome]))} not right, such as "
                f"scan {_told(missing[0])}"
            )
    left_out = len(lines) - MAX_MISSES
    if left_out > 0:
        lines = [*lines[:MAX_MISSES], f"- and {left_out} more"]
    return "\n".join(lines or ["None."]) + "\n"


def _row(name: str, runs: Sequence[Outcome]) -> tuple[str, ...]:
    scans, belonging = scans_of(runs), determined(runs)
    doubtful = [scan for scan in scans if scan.verdict == ScanVerdict.DOUBTFUL]
    strangers = [scan for scan in scans if scan.world is None]
    false = sum(scan.is_good and scan.is_false for scan in scans)
    verdicts = [run.verdict for run in runs]
    return (
        *(name, str(group_of(runs[0])), str(len(runs)), str(len(scans))),
        _percent(belonging, lambda scan: scan.is_right),
        _percent(belonging, lambda scan: scan.is_right and scan.is_good),
        f"**{false}**" if false else "0",
        *(str(len(doubtful)), str(sum(scan.is_false for scan in doubtful))),
        str(sum(scan.standing == Standing.UNPLACED for scan in belonging)),
        str(sum(scan.is_apart for scan in belonging)),
        f"{sum(scan.is_good for scan in strangers)}/{len(strangers)}" if strangers else "",
        ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts)),
        f"{median(run.seconds for run in runs):.0f}",
    )


def _percent(scans: Sequence[ScanOutcome], holds: Callable[[ScanOutcome], bool]) -> str:
    return f"{100 * share(scans, holds):.0f}" if scans else ""


def _told(scan: ScanOutcome) -> str:
    error = ""
    if scan.rotation_deg is not None and scan.translation_percent is not None:
        error = f" by {scan.rotation_deg:.1f} deg and {scan.translation_percent:.1f} %"
    apart = ", apart from the others" if scan.is_apart else ""
    told = f"{scan.source} ({scan.verdict}, {scan.standing}{error}{apart})"
    return f"{told}: {scan.reason}" if scan.reason else told
