"""Basins of convergence: how far from the truth a method may start."""

from collections.abc import Sequence

from benchmarks.paper.baselines.own import jointly_refined
from benchmarks.paper.methods import need_all, try_methods
from benchmarks.paper.views import MADE, Error, KnownPair, pair_units, virtual_pair
from benchmarks.study.study import Result, Unit
from scanweld.geometry.pose import Pose

NAME = "basins"

GAPS = (30, 60, 90)
AZIMUTHS = tuple(range(0, 360, 45))
START_DEG = (2, 5, 10, 20, 30, 40)
FROM_A_START = ("icp", "trimmed-icp", "gicp", "point-to-plane", "m-icc", "mm-icc")
JOINT, DEFAULT = "joint", "default"
QUICK_METHODS = ("icp", "trimmed-icp", "m-icc", "mm-icc")


def units(quick: bool) -> list[Unit]:
    """One unit a pair of views; every azimuth has a random axis of its own."""
    if quick:
        starts = {"starts": [5, 20, 40], "methods": QUICK_METHODS}
        return [{"object": MADE, "gap": 60, "azimuth": a, **starts} for a in (0, 135)]
    need_all(FROM_A_START)
    return pair_units(GAPS, AZIMUTHS, starts=START_DEG)


def measure(unit: Unit) -> Result:
    """What all methods make of a pair, from poses farther and farther from the truth."""
    pair, seed = virtual_pair(unit["object"], unit["azimuth"], unit["gap"]), unit["azimuth"]
    answers = {}
    for degrees in unit["starts"]:
        start = pair.start(degrees, seed)
        poses = jointly_refined((pair.i, pair.j), start)
        tried = _errors(pair, unit.get("methods", FROM_A_START), start[1], seed)
        answers[str(degrees)] = {**tried, JOINT: pair.error(poses[0].inverse() @ poses[1])}
    return {"answers": answers, **_errors(pair, [DEFAULT], pair.true, seed)}


def _errors(pair: KnownPair, methods: Sequence[str], start: Pose, seed: int) -> dict[str, Error]:
    tried = try_methods(methods, pair, start, seed)
    return {name: {key: each[key] for key in ("deg", "percent")} for name, each in tried.items()}
