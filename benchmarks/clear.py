"""Quick against thorough search on the calibration's sets: what makes a pair clear enough.

A pair of a quick search is *clear* where its kind is good and its score and margin reach multiples
of what a good pair needs. It is held against the truth and against the thorough search.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product

from benchmarks.calibration.scenes import make_set
from benchmarks.judging.trial import is_right_pair
from benchmarks.kept import Kept, Record, Result, Unit
from benchmarks.results import Json
from benchmarks.virtual.scene import Scene as Truth
from scanweld.config import Config
from scanweld.errors import InputError
from scanweld.evidence.field import ScanField
from scanweld.heat.features import describe
from scanweld.knowledge.facts import Knowledge
from scanweld.pairs.problem import PairProblem
from scanweld.pairs.quick import CLEAR_MARGIN, CLEAR_SCORE
from scanweld.pairs.registrar import Edge, PairRegistrar, PairScan, PairTask
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pipeline.intake import Intake, take_in
from scanweld.pipeline.stages import lay_out
from scanweld.work.progress import NoCache, silent
from scanweld.work.stage_log import Stages

NUM_SETS, NUM_ALL, NUM_GOOD = 450, 20, 65
"""Sets; those of them of which all pairs, and good ones, are searched thoroughly too."""
SCORES, MARGINS = (1.0, 1.25, CLEAR_SCORE, 2.0, 3.0), (1.0, CLEAR_MARGIN, 1.5, 1.75, 2.0)
"""Multiples of the score and of the margin of a good pair."""


@dataclass(kw_only=True)
class ClearPairs(Kept):
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
        truth = make_set(unit["seed"])
        try:
            return {"pairs": [pair.searched(unit["thorough"]) for pair in pairs_of(truth)]}
        except InputError:
            return {"pairs": []}


@dataclass(frozen=True, kw_only=True, slots=True)
class Pair:
    """A pair of a set, and all that searching it takes."""

    edge: Edge
    truth: Truth
    intake: Intake
    fields: Sequence[ScanField]
    registrar: PairRegistrar
    parts: dict[int, PairScan]  # Of the scans for which something asked for them

    def searched(self, thorough: str) -> Json:
        """What the quick search says, and of all pairs, or of good ones, the thorough one."""
        task, fields = PairTask(edge=self.edge), [self.fields[k] for k in self.edge]
        quick = self.registrar.search_quickly(task, *fields)
        told = self._told(quick)
        if thorough == "none" or (thorough == "good" and not told["good"]):
            return told
        config = self.registrar.config
        for k in self.edge:
            if k not in self.parts:
                prepared = self.intake.prepared[k]
                self.parts[k] = self.registrar.scan(prepared, describe(prepared, config.heat))
        slow = self.registrar.register(task, *(self.parts[k] for k in self.edge))
        both = [result.best for result in (quick, slow) if result.best is not None]
        i, j = fields
        problem = PairProblem(edge=self.edge, i=i, j=j, config=config.pairs)
        is_same = len(both) == 2 and problem.is_same(*both)
        return {**told, "thorough": self._told(slow), "same": is_same}

    def _told(self, result: PairResult) -> Json:
        i, j = (self.intake.prepared[k] for k in self.edge)
        is_right, best = False, result.best
        if best is not None:
            between = i.scan_from_sensor @ best.i_from_j @ j.scan_from_sensor.inverse()
            is_right = is_right_pair(i.name, j.name, between, self.truth)
        return {
            **{"i": i.name, "j": j.name, "good": result.kind is PairKind.GOOD},
            **{"right": is_right, "margin": result.margin},
            "score": 0.0 if best is None else best.score,
        }


def pairs_of(truth: Truth) -> list[Pair]:
    """The pairs of a set.

    Raises:
        InputError: If fewer than two of its scans are usable.
    """
    config, stages = Config(), Stages(workers=1, cache=NoCache(), progress=silent)
    intake = take_in(truth.scans, {}, Knowledge(), config, stages)
    shared = {
        **{"truth": truth, "intake": intake, "registrar": PairRegistrar(config=config)},
        **{"fields": lay_out(intake, config, stages).fields, "parts": {}},
    }
    return [Pair(edge=edge, **shared) for edge in combinations(range(len(intake.prepared)), 2)]


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
