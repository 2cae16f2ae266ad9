"""What the page of Table 2 tells of its records."""

from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any

import numpy as np

from benchmarks.paper.settings import NUMERALS, SETTINGS, TUNED, is_converged
from benchmarks.study.pages import grid, markdown_table
from benchmarks.study.records import Records, of, values_of
from benchmarks.study.study import Record

Run = Mapping[str, Any]

TITLES = {
    "m-icc": "M-ICC",
    "mm-icc": "MM-ICC",
    "joint": "joint refinement",
    "default": "default",
}
COMPLEX = ("ii", "iii", "v", "vi", "vii")
"""Where the paper says that M-ICC gives in."""


def runs(records: Records, **wanted: object) -> list[Run]:
    """The runs of all records that have these values."""
    told = chain.from_iterable(record.result["runs"] for record in records)
    return [run for run in told if all(run[key] == value for key, value in wanted.items())]


def count(of_runs: Iterable[Run]) -> int:
    """How many runs converge."""
    return sum(map(is_converged, of_runs))


def share(of_runs: list[Run]) -> str:
    """How many runs of all converge."""
    return f"{count(of_runs)}/{len(of_runs)}"


def rms_percent(record: Record) -> float:
    """Mean RMS of the runs that converged, in % of the diameter; NaN if none did."""
    right = [run["rms_percent"] for run in record.result["runs"] if is_converged(run)]
    return float(np.mean(right)) if right else float("nan")


def rms_mm(record: Record) -> float:
    """The same in the unit of the mesh: mm."""
    return rms_percent(record) * record.result["diameter"] / 100


def middle_rms(records: Records) -> float:
    """Median over the records with any run that converged, in mm."""
    return float(np.nanmedian([rms_mm(record) for record in records]))


def settings_table(records: Records) -> str:
    """The paper's columns beside ours."""

    def title(numeral: str) -> str:
        setting = SETTINGS[numeral]
        views = f"{setting.gap_deg}°, {setting.num_views} {setting.kind} views"
        azimuths = of(records, setting=numeral)[0].result["azimuths_deg"]
        return f"({numeral}) {setting.name}, {views} ({', '.join(f'{a:g}' for a in azimuths)}°)"

    def cell(numeral: str, column: str | int) -> str:
        if isinstance(column, int):
            printed = SETTINGS[numeral].printed[column]
            return f"{printed:.3f}" if printed else ""
        [record] = of(records, setting=numeral, method=column)
        percent = rms_percent(record)
        rms = "-" if np.isnan(percent) else f"{rms_mm(record):.3f} ({percent:.3f})"
        return f"{share(record.result['runs'])}: {rms}"

    rows = {title(numeral): numeral for numeral in values_of(records, "setting")}
    ours = {f"{title}: converged, RMS mm (%)": method for method, title in TITLES.items()}
    columns = {"paper, M-ICC": 0, "paper, proposed": 1, **ours}
    return grid("setting (azimuths)", rows, columns, cell)


def sweep_table(records: Records) -> tuple[str, dict[str, str]]:
    """Converged runs by tuning and setting; by method which tuning beats the one in use."""
    numerals = values_of(records, "setting")
    rows: list[list[str]] = []
    better = {}
    for method in values_of(records, "method"):
        counts: dict[str, list[int]] = {}
        for record in of(records, method=method):
            of_tuning = counts.setdefault(_tuning_title(record.unit), [0] * len(numerals))
            of_tuning[numerals.index(record.unit["setting"])] += count(record.result["runs"])
        used = _tuning_title({"method": method, **TUNED[method]})
        for tuning, converged in counts.items():
            cells = [tuning, *map(str, converged), str(sum(converged))]
            rows.append([f"**{cell}**" for cell in cells] if tuning == used else cells)
        most = [max(column) for column in zip(*counts.values(), strict=True)]
        rows.append([f"{TITLES[method]}, best of each", *map(str, most), str(sum(most))])
        best = max(counts, key=lambda tuning: sum(counts[tuning]))
        is_best = sum(counts[best]) == sum(counts[used])
        better[TITLES[method]] = "no other" if is_best else best
    return markdown_table(["tuning", *(f"({n})" for n in numerals), "all"], rows), better


def _tuning_title(unit: Mapping[str, Any]) -> str:
    trim = "auto" if unit["trim"] is None else f"{unit['trim']:g}"
    kept = "" if unit["method"] == "m-icc" else f", {trim}"
    return f"{TITLES[unit['method']]} {unit['tau']:g} px, {unit['renders']}{kept}"


def floors(records: Records) -> list[tuple[str, list[str]]]:
    """What must hold, and the settings where it does not."""
    at = {(r.unit["setting"], r.unit["method"]): r for r in records}
    iccs = {n: [at[n, m].result["runs"] for m in ("mm-icc", "m-icc")] for n in NUMERALS}
    gain = {n: count(ours) - count(theirs) for n, (ours, theirs) in iccs.items()}
    told = {n: f"{n} ({' against '.join(map(share, pair))})" for n, pair in iccs.items()}
    rms = {n: {method: rms_mm(at[n, method]) for method in TITLES} for n in NUMERALS}
    least = {n: min(by["m-icc"], by["mm-icc"]) for n, by in rms.items()}
    return [
        (
            "MM-ICC converges at least as often as M-ICC",
            [told[n] for n in NUMERALS if gain[n] < 0],
        ),
        (f"and more often in {', '.join(COMPLEX)}", [told[n] for n in COMPLEX if gain[n] <= 0]),
        (
            "the default's RMS is below that of M-ICC and MM-ICC",
            [n for n in NUMERALS if not rms[n]["default"] < least[n]],
        ),
        (
            "and below the paper's, read as mm",
            [n for n in NUMERALS if not rms[n]["default"] < SETTINGS[n].printed[1]],
        ),
    ]
