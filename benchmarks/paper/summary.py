"""What the pages of the study say of its records, beside what their templates do."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, product
from typing import Any

import numpy as np

from benchmarks.blocks import TEMPLATES
from benchmarks.paper.basins import DEFAULT, FROM_A_START, JOINT
from benchmarks.paper.methods import METHODS
from benchmarks.paper.settings import NUMERALS, SETTINGS, is_converged
from benchmarks.study import records as pick
from benchmarks.study.records import Answer, Limit, Records
from benchmarks.study.study import Record
from scanweld.geometry.arrays import FloatArray

Run = Mapping[str, Any]

TIGHT, RIGHT = Limit(deg=2, percent=1), Limit(deg=1, percent=1)
BASIN = Limit(deg=5, percent=2)
REFINED = METHODS.keys() - {"paper-coarse"}
"""What is not refined is held to the basin."""

NEAR_GAP = 90
"""To this gap every pair must be right; beyond it the overlap says what can be asked."""
OVERLAPS = ((0.15, 1.01, 0.95), (0.10, 0.15, 0.80), (0.0, 0.10, None))
"""From, below, and the share of pairs that must be right there."""
STARTS_OF = {"identity": "the paper's start", "random": "any start"}

BINS = ((0.4, 1.01), (0.25, 0.4), (0.15, 0.25), (0.10, 0.15), (0.05, 0.10), (0.0, 0.05))
TITLES = {"m-icc": "M-ICC", "mm-icc": "MM-ICC", "joint": "joint refinement", "default": "default"}
"""Of the methods of Table 2."""
COMPLEX = ("ii", "iii", "v", "vi", "vii")
"""Where the paper says that M-ICC gives in."""


def best_but_default(records: Records, limit: Limit, methods: Iterable[str]) -> str | None:
    """Which of some other methods is right most often; None if none was tried."""
    tried = [m for m in METHODS if m in methods and m != "default" and pick.answers(records, m)]
    return max(tried, key=lambda m: limit.share(pick.answers(records, m)), default=None)


def degrees(answers: Iterable[Answer]) -> list[float]:
    """Rotation errors; half a turn where there is no answer."""
    return [180.0 if each["deg"] is None else each["deg"] for each in answers]


def noise_title(noise: float) -> str:
    """Standard deviation of the depth in words."""
    return f"noise {100 * noise:g} %" if noise else "no noise"


def floors_of_pairs(records: Records) -> Iterator[tuple[str, Records, Limit, float]]:
    """What is asked of the default: in words, of which pairs, how exact, and of what share."""
    floors = [(low, high, floor) for low, high, floor in OVERLAPS if floor is not None]
    for value in pick.values_of(records, "noise"):
        noise, chosen = noise_title(value), pick.of(records, noise=value)
        for protocol, name in product(
            pick.values_of(chosen, "protocol"), pick.values_of(chosen, "object")
        ):
            near = pick.up_to(pick.of(chosen, object=name, protocol=protocol), NEAR_GAP)
            yield f"{name}, {STARTS_OF[protocol]}, to {NEAR_GAP}°, {noise}", near, RIGHT, 1.0
        pairs = pick.of(chosen, protocol="random")
        for low, _, floor in floors:
            where = f"any start, any gap, overlap from {low:.2f}, {noise}"
            yield where, pick.overlapping(pairs, low, 1.01), TIGHT, floor
        for low, high, floor in floors:
            where = (
                f"any start, beyond {NEAR_GAP}°, overlap {pick.overlap_title(low, high)}, {noise}"
            )
            yield where, pick.overlapping(pick.beyond(pairs, NEAR_GAP), low, high), TIGHT, floor


def pooled(records: Iterable[Record], group: str, question: str, entry: str) -> FloatArray:
    """Right, asked and by chance right (3,) of a detector or descriptor, over all records."""
    told = [found.get(question, [0, 0, 0]) for found in pick.results(records, group, entry)]
    return np.array(told, dtype=np.float64).reshape(-1, 3).sum(axis=0)


def from_starts(records: Records) -> dict[str, str]:
    """The methods that were tried from starts, by their titles."""
    titles = {METHODS[name].title: name for name in FROM_A_START}
    titles |= {"joint refinement": JOINT, "default": DEFAULT}
    tried = {DEFAULT, *next(iter(records[0].result["answers"].values()))}
    return {title: method for title, method in titles.items() if method in tried}


def answers_from(records: Records, start: int, method: str) -> list[Answer]:
    """Errors of a method from a start; those of the default are the same from all."""
    path = [DEFAULT] if method == DEFAULT else ["answers", str(start), method]
    return pick.results(records, *path)


def runs(records: Records, **wanted: object) -> list[Run]:
    """The runs of all records that have these values."""
    told = chain.from_iterable(pick.results(records, "runs"))
    return [run for run in told if all(run[key] == value for key, value in wanted.items())]


def count(of_runs: Iterable[Run]) -> int:
    """How many runs converge."""
    return sum(map(is_converged, of_runs))


def rms_percent(record: Record) -> float:
    """Mean RMS of the runs that converged, in % of the diameter; NaN if none did."""
    right = [run["rms_percent"] for run in record.result["runs"] if is_converged(run)]
    return float(np.mean(right)) if right else float("nan")


def rms_mm(record: Record) -> float:
    """The same in the unit of the mesh: mm."""
    return rms_percent(record) * record.result["diameter"] / 100


def floors_of_settings(records: Records) -> dict[str, list[str]]:
    """What must hold, and the settings where it does not."""
    at = {(r.unit["setting"], r.unit["method"]): r for r in records}
    told, gain, below = {}, {}, {}
    for n in NUMERALS:
        ours, theirs = (at[n, method].result["runs"] for method in ("mm-icc", "m-icc"))
        gain[n] = count(ours) - count(theirs)
        told[n] = f"{n} ({count(ours)}/{len(ours)} against {count(theirs)}/{len(theirs)})"
        rms = {method: rms_mm(at[n, method]) for method in TITLES}
        below[n] = (
            (rms["default"] < min(rms["m-icc"], rms["mm-icc"])),
            (rms["default"] < SETTINGS[n].printed[1]),
        )
    return {
        "MM-ICC converges at least as often as M-ICC": [told[n] for n in told if gain[n] < 0],
        f"and more often in {', '.join(COMPLEX)}": [told[n] for n in COMPLEX if gain[n] <= 0],
        "the default's RMS is below that of M-ICC and MM-ICC": [n for n in told if not below[n][0]],
        "and below the paper's, read as mm": [n for n in told if not below[n][1]],
    }


_HELPERS = ("answers", "beyond", "by_overlap", "grouped", "of", "overlap_title", "overlapping")
TEMPLATES.globals.update(
    {name: vars(pick)[name] for name in (*_HELPERS, "results", "up_to", "values_of")}
)
TEMPLATES.filters.update(rms_mm=rms_mm)
