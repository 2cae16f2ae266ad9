"""The page docs/trust.md: hand-written, but for its measured parts, which have templates."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import median

from benchmarks import blocks
from benchmarks.calibration.report import calibration_told
from benchmarks.judging import outcomes as judged
from benchmarks.judging.floors import Floor, floors, real_sets
from benchmarks.judging.other_tools import TITLES, answers_by_tool
from benchmarks.judging.outcomes import CRASH, ERROR, Outcome, determined, scans_of, share
from benchmarks.kept import read_records
from benchmarks.results import Json, how_measured, read_results, write_file
from benchmarks.scores import bound, draw
from benchmarks.seeds import spent_among
from benchmarks.virtual.scene import Group
from scanweld.pairs.result import PairKind

PAGE = "trust.md"
MAX_MISSES = 80


@dataclass(frozen=True)
class Results:
    """What was measured, in a folder such as docs.

    Its properties raise FileNotFoundError if it was not.
    """

    folder: Path

    def document(self, name: str) -> Json:
        """Records and what stands beside them: the command, the machine, the code."""
        return read_results(self.folder / f"data/{name}.json")

    @cached_property
    def outcomes(self) -> list[Outcome]:
        """All runs."""
        return [Outcome.of(r.unit, r.result) for r in read_records(self.folder, "trust")]

    @cached_property
    def floors(self) -> list[Floor]:
        """What must be shown, and is."""
        return [*floors(self.outcomes), real_sets(self.document("sets")["records"])]


def page_text(text: str, results: Results) -> str:
    """The page with its measured parts as the results have them now."""
    return blocks.rewritten(text, lambda name: block(name, results))


def block(name: str, results: Results) -> str:
    """A measured part of the page."""
    try:
        return blocks.rendered(name, **BLOCKS[name](results))
    except FileNotFoundError:
        return "Not measured yet.\n"


def write_page(folder: Path) -> None:
    """Draw its pictures, and write the measured parts of the folder's page anew."""
    results = Results(folder)
    if (folder / "data/trust.json").exists():
        stated = judged.stated_pairs(results.outcomes), judged.stated_scans(results.outcomes)
        draw(dict(zip(("pairs", "placed scans"), stated, strict=True)), folder, "trust")
    page = folder / PAGE
    write_file(page, page_text(page.read_text(encoding="utf-8"), results))


def by_scenario(outcomes: Sequence[Outcome]) -> Json:
    """Runs, scans, and scans whose pose is determined, of each scenario."""
    names = dict.fromkeys(outcome.scenario for outcome in outcomes)
    runs = {name: [o for o in outcomes if o.scenario == name] for name in names}
    return {
        "scenarios": [
            {
                **{"name": name, "group": str(of[0].group), "num_runs": len(of)},
                **{"scans": scans_of(of), "belonging": determined(of)},
                "verdicts": [run.verdict for run in of],
                "seconds": median(run.seconds for run in of),
            }
            for name, of in runs.items()
        ],
        "share": share,
    }


def by_kind(outcomes: Sequence[Outcome]) -> Json:
    """What two scans alone say, and how often they are right; pairs without a pose left out."""
    kinds = []
    for kind in PairKind:
        of = [pair for pair in judged.posed_pairs(outcomes) if pair.kind is kind]
        accepted = [pair for pair in of if pair.is_accepted]
        runs = sum(
            any(p.is_accepted and p.kind is kind for p in judged.posed_pairs([o])) for o in outcomes
        )
        kinds.append({"kind": str(kind), "pairs": of, "accepted": accepted, "num_runs": runs})
    return {"kinds": kinds, "bound": bound}


def misses(outcomes: Sequence[Outcome]) -> Json:
    """Every failure, every falsely good scan, and every run with scans missing, in words."""
    lines = [line for outcome in outcomes for line in _misses(outcome)]
    return {"lines": lines[:MAX_MISSES], "more": len(lines[MAX_MISSES:])}


def _misses(outcome: Outcome) -> Iterator[Json]:
    head = {"run": f"{outcome.scenario}, seed {outcome.seed}"}
    if outcome.verdict in (CRASH, ERROR):
        yield {**head, "failure": outcome.verdict, "why": outcome.reason.strip().splitlines()[-1]}
    for scan in outcome.scans:
        if scan.is_good and scan.is_false:
            yield {**head, "scan": scan}
    asked = determined([outcome])
    missing = [scan for scan in asked if not scan.is_right]
    if missing and outcome.group not in (Group.SYMMETRIC, Group.REPORTED, Group.TWO_BODIES):
        yield {**head, "missing": len(missing), "asked": len(asked), "scan": missing[0]}


def seeds_of(seeds: Sequence[int]) -> Json:
    """The range of the seeds of a page, and which entries say that they are spent."""
    return {"first": min(seeds), "last": max(seeds), "spent": spent_among(seeds)}


def _floors(results: Results) -> Json:
    document = results.document("trust")
    hours = sum(outcome.seconds for outcome in results.outcomes) / 3600
    told = {"how": how_measured(document), "code": document["code"], "hours": hours}
    return {**told, "num_runs": len(results.outcomes), "floors": results.floors}


def _tools(results: Results) -> Json:
    answers = answers_by_tool(read_records(results.folder, "rivals"), results.outcomes)
    return {"tools": answers, "titles": TITLES}


BLOCKS: dict[str, Callable[[Results], Json]] = {
    "trust-seeds": lambda results: seeds_of([o.seed for o in results.outcomes]),
    "trust-floors": _floors,
    "trust-scenarios": lambda results: by_scenario(results.outcomes),
    "trust-confidence": lambda results: {
        "stated": {
            "pairs": judged.stated_pairs(results.outcomes),
            "scans": judged.stated_scans(results.outcomes),
        }
    },
    "trust-rivals": _tools,
    "trust-kinds": lambda results: by_kind(results.outcomes),
    "trust-misses": lambda results: misses(results.outcomes),
    "calibration": lambda results: calibration_told(results.document("calibration")),
}
"""Measured part of the page, and its template -> what it says."""
