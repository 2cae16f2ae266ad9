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
from scanweld.heat.features import describe
from scanweld.knowledge.facts import Knowledge
from scanweld.pairs.quick import CLEAR_MARGIN, CLEAR_SCORE
from scanweld.pairs.registrar import Edge, PairRegistrar
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pipeline.intake import Intake, take_in
from scanweld.pipeline.method import Scene
from scanweld.pipeline.robust import robust_method
from scanweld.pipeline.stages import lay_out
from scanweld.work.progress import NoCache, silent
from scanweld.work.stage_log import Stages

NUM_SETS, NUM_THOROUGH = 600, 200
SCORES, MARGINS = (1.0, 1.25, CLEAR_SCORE, 2.0, 3.0), (1.0, CLEAR_MARGIN, 1.5, 1.75, 2.0)
"""Multiples of the score and of the margin of a good pair."""


@dataclass(kw_only=True)
class ClearPairs(Kept):
    """All pairs of the sets by seed, searched quickly; those of the first also thoroughly."""

    num_sets: int = NUM_SETS
    NAME: str = "clear"

    def units(self, quick: bool) -> list[Unit]:
        """The quick searches first: they tell the most the soonest."""
        num = min(self.num_sets, 2) if quick else self.num_sets
        thorough = [{"seed": k, "thorough": True} for k in range(min(num, NUM_THOROUGH))]
        return [*({"seed": seed, "thorough": False} for seed in range(num)), *thorough]

    def measure(self, unit: Unit) -> Result:
        """What a quick search says of every pair, and what is true of it."""
        truth, config = make_set(unit["seed"]), Config()
        stages = Stages(workers=1, cache=NoCache(), progress=silent)
        try:
            intake = take_in(truth.scans, {}, Knowledge(), config, stages)
        except InputError:
            return {"pairs": []}
        scene = Scene(intake=intake, judge=lay_out(intake, config, stages))
        method, prepared = robust_method(scene, config), intake.prepared
        registrar = method.shortcuts
        assert isinstance(registrar, PairRegistrar)
        features = {}
        if unit["thorough"]:
            features = {k: describe(scan, config.heat) for k, scan in enumerate(prepared)}
        told = []
        for edge in combinations(range(len(prepared)), 2):
            quick = registrar.search_quickly(edge)
            pair = _told(quick, edge, intake, truth)
            if unit["thorough"]:
                thorough = method.register(edge, features)
                pair["thorough"] = _told(thorough, edge, intake, truth)
                both = [result.best for result in (quick, thorough) if result.best is not None]
                pair["same"] = len(both) == 2 and registrar.problem(edge).is_same(*both)
            told.append(pair)
        return {"pairs": told}


def _told(result: PairResult, edge: Edge, intake: Intake, truth: Truth) -> Json:
    i, j = (intake.prepared[k] for k in edge)
    is_right, best = False, result.best
    if best is not None:
        between = i.scan_from_sensor @ best.i_from_j @ j.scan_from_sensor.inverse()
        is_right = is_right_pair(i.name, j.name, between, truth)
    return {
        **{
            "i": i.name,
            "j": j.name,
            "good": result.kind is PairKind.GOOD,
            "right": is_right,
            "margin": result.margin,
        },
        **{"score": best.score if best else 0.0, "is_open": bool({i.name, j.name} & truth.is_open)},
    }


def over_limits(records: Sequence[Record]) -> Json:
    """How many pairs are clear by each limit on score and margin, and how many of these wrong."""
    quick, both = (
        [pair for r in records if r.unit["thorough"] is of for pair in r.result["pairs"]]
        for of in (False, True)
    )
    return {
        **{"kind": "clear", "chosen": [CLEAR_SCORE, CLEAR_MARGIN], "pairs": len(quick)},
        **{"sets": sum(not r.unit["thorough"] for r in records), "both": len(both)},
        "thorough_good": sum(_is_sure(pair) for pair in both),
        "thorough_wrong": sum(_is_sure(p) and not p["thorough"]["right"] for p in both),
        "limits": [_at(quick, both, *limits) for limits in product(SCORES, MARGINS)],
    }


def _at(quick: Sequence[Json], both: Sequence[Json], score: float, margin: float) -> Json:
    """Clear pairs, wrong ones of them, and what the thorough search says of clear pairs."""
    config = Config().pairs

    def clear(pairs: Sequence[Json]) -> list[Json]:
        least = score * config.min_score, margin * config.min_margin
        return [
            p for p in pairs if p["good"] and p["score"] >= least[0] and p["margin"] >= least[1]
        ]

    of_both = clear(both)
    return {
        **{"score": score, "margin": margin, "clear": len(clear(quick))},
        "wrong": sum(not pair["right"] for pair in clear(quick)),
        **{"clear_of_both": len(of_both), "other_pose": sum(not p["same"] for p in of_both)},
        "not_good": sum(not _is_sure(pair) for pair in of_both),
        # Wrong by the shortcut alone: the thorough search does not assert the same.
        "shortcut_wrong": sum(not p["right"] and not (p["same"] and _is_sure(p)) for p in of_both),
    }


def _is_sure(pair: Json) -> bool:
    return pair["thorough"]["good"]
