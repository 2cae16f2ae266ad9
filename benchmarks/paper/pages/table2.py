"""What stands on the page of Table 2."""

from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.settings import (
    COARSE_DEG,
    COARSE_PERCENT,
    CONVERGED_DEG,
    CONVERGED_PERCENT,
    NUMERALS,
    SETTINGS,
    STARTS,
    SWEEP_DEG,
    TUNED,
    is_converged,
)
from benchmarks.study.pages import grid, markdown_table
from benchmarks.study.records import of, values_of
from benchmarks.study.study import Record

Records = Sequence[Record]
Runs = Sequence[Mapping[str, Any]]

TITLES = {
    "m-icc": "M-ICC",
    "mm-icc": "MM-ICC",
    "joint": "joint refinement",
    "default": "default",
}
COMPLEX = ("ii", "iii", "v", "vi", "vii")
"""Where the paper says that M-ICC gives in."""


def values(records: Records, out: Path) -> Mapping[str, Any]:
    """What fills the template."""
    final, sweep = of(records, part="final"), of(records, part="sweep")
    by_noise = {noise: of(final, noise=noise) for noise in values_of(final, "noise")}
    starts = {f"{start}° off": start for start, _ in STARTS} | {"published coarse pose": "coarse"}
    from_a_start = {title: method for method, title in TITLES.items() if method != "default"}
    return {
        "converged": {title: _share(runs(of(final, method=m))) for m, title in TITLES.items()},
        "rms": np.nanmedian([rms_mm(record) for record in of(final, method="default")]),
        "limit": f"{CONVERGED_DEG:g}° and {CONVERGED_PERCENT:g} %",
        "coarse_limit": f"< {COARSE_DEG:g}°, < {COARSE_PERCENT:g} %",
        "settings": {_noise_title(noise): _settings_table(r) for noise, r in by_noise.items()},
        "starts": grid(
            "converged",
            from_a_start,
            starts,
            lambda m, start: _share([r for r in runs(of(final, method=m)) if r["start"] == start]),
        ),
        "sweep": _sweep(sweep) if sweep else {},
        "floors": _floors(by_noise) if set(values_of(final, "setting")) == set(NUMERALS) else "",
    }


def runs(records: Records) -> list[Mapping[str, Any]]:
    """The runs of all records."""
    return list(chain.from_iterable(record.result["runs"] for record in records))


def _count(of_runs: Runs) -> int:
    return sum(map(is_converged, of_runs))


def _share(of_runs: Runs) -> str:
    return f"{_count(of_runs)}/{len(of_runs)}"


def _noise_title(noise: float) -> str:
    return f"{100 * noise:g} % depth noise" if noise else "Noise-free"


def _rms_percent(record: Record) -> float:
    """Mean RMS of the runs that converged, in % of the diameter; NaN if none did."""
    right = [run["rms_percent"] for run in record.result["runs"] if is_converged(run)]
    return float(np.mean(right)) if right else float("nan")


def rms_mm(record: Record) -> float:
    """The same in the unit of the mesh: mm."""
    return _rms_percent(record) * record.result["diameter"] / 100


def _settings_table(records: Records) -> str:
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
        share, percent = _share(record.result["runs"]), _rms_percent(record)
        return f"{share}: " + (
            "-" if np.isnan(percent) else f"{rms_mm(record):.3f} ({percent:.3f})"
        )

    rows = {title(numeral): numeral for numeral in values_of(records, "setting")}
    ours = {f"{title}: converged, RMS mm (%)": method for method, title in TITLES.items()}
    columns = {"paper, M-ICC": 0, "paper, proposed": 1, **ours}
    return grid("setting (azimuths)", rows, columns, cell)


def _sweep(records: Records) -> dict[str, Any]:
    """Converged runs by tuning and setting, and whether the tuning in use is the best one."""
    numerals = values_of(records, "setting")
    rows: list[Sequence[str]] = []
    better: dict[str, str] = {}
    for method in values_of(records, "method"):
        of_method = of(records, method=method)
        tunings = list(dict.fromkeys(_tuning(record.unit) for record in of_method))
        counts = {
            tuning: [
                _count(runs([r for r in of(of_method, setting=n) if _tuning(r.unit) == tuning]))
                for n in numerals
            ]
            for tuning in tunings
        }
        used = _tuning(TUNED[method])
        for tuning, converged in counts.items():
            cells = [_tuning_title(method, tuning), *map(str, converged), str(sum(converged))]
            rows.append([f"**{cell}**" for cell in cells] if tuning == used else cells)
        most = [max(column) for column in zip(*counts.values(), strict=True)]
        rows.append([f"{TITLES[method]}, best of each", *map(str, most), str(sum(most))])
        best = max(counts, key=lambda tuning: sum(counts[tuning]))
        is_best = sum(counts[best]) == sum(counts[used])
        better[TITLES[method]] = "no other" if is_best else _tuning_title(method, best)
    return {
        "num": records[0].unit["seeds"],
        "deg": SWEEP_DEG,
        "better": better,
        "table": markdown_table(["tuning", *(f"({n})" for n in numerals), "all"], rows),
    }


def _tuning(unit: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(unit[key] for key in ("tau", "renders", "trim"))


def _tuning_title(method: str, tuning: tuple[Any, ...]) -> str:
    tau, renders, trim = tuning
    kept = "" if method == "m-icc" else f", {'auto' if trim is None else f'{trim:g}'}"
    return f"{TITLES[method]} {tau:g} px, {renders}{kept}"


def _floors(by_noise: Mapping[float, Records]) -> str:
    """What must hold, and the settings where it does not."""
    rows = []
    for noise, records in by_noise.items():
        at = {(r.unit["setting"], r.unit["method"]): r for r in records}
        iccs = {
            n: [at[n, method].result["runs"] for method in ("mm-icc", "m-icc")] for n in NUMERALS
        }
        gain = {n: _count(ours) - _count(theirs) for n, (ours, theirs) in iccs.items()}
        told = {n: f"{n} ({' against '.join(map(_share, pair))})" for n, pair in iccs.items()}
        rms = {n: {method: rms_mm(at[n, method]) for method in TITLES} for n in NUMERALS}
        failing = {
            "MM-ICC converges at least as often as M-ICC": [
                told[n] for n in NUMERALS if gain[n] < 0
            ],
            f"and more often in {', '.join(COMPLEX)}": [told[n] for n in COMPLEX if gain[n] <= 0],
            "the default's RMS is below that of M-ICC and MM-ICC": [
                n for n, of in rms.items() if not of["default"] < min(of["m-icc"], of["mm-icc"])
            ],
            "and below the paper's, read as mm": [
                n for n, of in rms.items() if not of["default"] < SETTINGS[n].printed[1]
            ],
        }
        rows += [
            (f"{100 * noise:g} %", claim, f"**FAIL** in {', '.join(where)}" if where else "pass")
            for claim, where in failing.items()
        ]
    return markdown_table(["noise", "what must hold", ""], rows)
