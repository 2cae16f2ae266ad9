"""Quick against thorough search on the calibration's sets: what makes a pair clear enough.

A pair of a quick search is *clear* where its kind is good and its score and margin reach multiples
of what a good pair needs. It is held against the truth and against the thorough search.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations, product

from benchmarks.calibration.scenes import make_set
from benchmarks.judging.trial import is_right_pair
from benchmarks.kept import Record, Result, Unit
from benchmarks.results import Json
from benchmarks.virtual.scene import Scene as Truth
from scanweld.config import Config
from scanweld.errors import InputError
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import describe
from scanweld.knowledge.facts import Knowledge
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.quick import CLEAR_MARGIN, CLEAR_SCORE
from scanweld.pairs.registrar import PairRegistrar, PairScan, PairTask
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pipeline.intake import take_in
from scanweld.pipeline.stages import lay_out
from scanweld.work.progress import NoCache, silent
from scanweld.work.stage_log import Stages

NUM_SETS, NUM_ALL, NUM_GOOD = 450, 20, 65
"""Sets; those of them of which all pairs, and good ones, are searched thoroughly too."""
SCORES, MARGINS = (1.0, 1.25, CLEAR_SCORE, 2.0, 3.0), (1.0, CLEAR_MARGIN, 1.5, 1.75, 2.0)
"""Multiples of the score and of the margin of a good pair."""


@dataclass(kw_only=True)
class ClearPairs:
    """All pairs of sets, searched quickly; of the first sets thoroughly too."""

    num_sets: int = NUM_SETS
    NAME: str = "clear"

    def units(self, quick: bool) -> list[Unit]:
        """Sets by seed, and which of their pairs are searched thoroughly."""
        num = min(self.num_sets, 2) if quick else self.num_sets
        thorough = dict.fromkeys(range(NUM_GOOD), "good") | dict.fromkeys(range(NUM_ALL), "all")
        return [{"seed": seed, "thorough": thorough.get(seed, "none")} for seed in range(num)]

    def measure(self, unit: Unit) -> Result:
        """What both searches say of the pairs, and what is true of it."""
        try:
            return {"pairs": list(searched(make_set(unit["seed"]), unit["thorough"]))}
        except InputError:
            return {"pairs": []}


def searched(truth: Truth, thorough: str) -> Iterator[Json]:
    """What the quick search says of a set's pairs, and of all, or of good ones, the thorough one.

    Raises:
        InputError: If fewer than two scans of the set are usable.
    """
    config, stages = Config(), Stages(workers=1, cache=NoCache(), progress=silent)
    intake = take_in(truth.scans, {}, Knowledge(), config, stages)
    fields, scans = lay_out(intake, config, stages).fields, intake.prepared
    registrar = PairRegistrar(config=config)

    @cache
    def part(k: int) -> PairScan:
        return registrar.scan(scans[k], describe(scans[k], config.heat))

    for i, j in combinations(range(len(scans)), 2):
        task = PairTask(edge=(i, j))
        quick = registrar.search_quickly(task, fields[i], fields[j])
        told = _told(quick, scans[i], scans[j], truth)
        if thorough == "all" or (thorough == "good" and told["good"]):
            slow = registrar.register(task, part(i), part(j))
            both = [result.best for result in (quick, slow) if result.best is not None]
            problem = PairProblem(edge=(i, j), i=fields[i], j=fields[j], config=config.pairs)
            told["thorough"] = _told(slow, scans[i], scans[j], truth)
            told["same"] = len(both) == 2 and problem.is_same(*both)
        yield told


def _told(result: PairResult, i: PreparedScan, j: PreparedScan, truth: Truth) -> Json:
    is_right, best = False, result.best
    if best is not None:
        between = i.scan_from_sensor @ best.i_from_j @ j.scan_from_sensor.inverse()
        is_right = is_right_pair(i.name, j.name, between, truth)
    return {
        **{"i": i.name, "j": j.name, "good": result.kind is PairKind.GOOD},
        **{"right": is_right, "margin": result.margin},
        "score": 0.0 if best is None else best.score,
    }


def over_limits(records: Sequence[Record]) -> Json:
    """How many pairs are clear by each limit on score and margin, and how many of these wrong."""
    pairs = [pair for record in records for pair in record.result["pairs"]]
    of_all = [pair for r in records if r.unit["thorough"] == "all" for pair in r.result["pairs"]]
    sure = [pair for pair in of_all if _is_sure(pair)]
    return {
        **{"kind": "clear", "chosen": [CLEAR_SCORE, CLEAR_MARGIN], "pairs": len(pairs)},
        **{"sets": len(records), "sets_of_all": sum(r.unit["thorough"] == "all" for r in records)},
        **{"pairs_of_all": len(of_all), "sure": len(sure)},
        "sure_wrong": sum(not pair["thorough"]["right"] for pair in sure),
        "sure_and_clear": len(_clear(sure, CLEAR_SCORE, CLEAR_MARGIN)),
        "limits": [_at(pairs, *limits) for limits in product(SCORES, MARGINS)],
    }


def _at(pairs: Sequence[Json], score: float, margin: float) -> Json:
    """Clear pairs, the wrong ones of them, and what the thorough search says of them."""
    clear = _clear(pairs, score, margin)
    both = [pair for pair in clear if "thorough" in pair]
    wrong = [pair for pair in both if not pair["right"]]
    return {
        **{"score": score, "margin": margin, "clear": len(clear)},
        **{"wrong": sum(not pair["right"] for pair in clear), "both": len(both)},
        **{"wrong_of_both": len(wrong), "other_pose": sum(not pair["same"] for pair in both)},
        # Not the shortcut's fault: the thorough search asserts the same pose.
        "wrong_by_both": sum(pair["same"] and _is_sure(pair) for pair in wrong),
        "not_sure": sum(not _is_sure(pair) for pair in both),
    }


def _clear(pairs: Sequence[Json], score: float, margin: float) -> list[Json]:
    config = Config().pairs
    least = score * config.min_score, margin * config.min_margin
    return [p for p in pairs if p["good"] and p["score"] >= least[0] and p["margin"] >= least[1]]


def _is_sure(pair: Json) -> bool:
    return pair["thorough"]["good"]
