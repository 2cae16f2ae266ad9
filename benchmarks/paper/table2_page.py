"""The page of Table 2."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.paper.pages import markdown_table
from benchmarks.paper.settings import (
    COARSE_DEG,
    COARSE_PERCENT,
    CONVERGED_DEG,
    CONVERGED_PERCENT,
    SETTINGS,
    STARTS,
    SWEEP,
    SWEEP_DEG,
    TITLES,
    TUNED,
    is_converged,
)
from benchmarks.paper.study import Record


def tell(records: Sequence[Record]) -> str:
    """The paper's columns beside ours, from where runs converge, the tuning, and the floors."""
    final = [record for record in records if record.unit["part"] == "final"]
    sweep = [record for record in records if record.unit["part"] == "sweep"]
    numerals = list(dict.fromkeys(record.unit["setting"] for record in final))
    noises = list(dict.fromkeys(record.unit["noise"] for record in final))
    parts = [_headline(final), _HOW_TO_READ]
    for noise in noises:
        at_noise = {
            (record.unit["setting"], record.unit["method"]): record
            for record in final
            if record.unit["noise"] == noise
        }
        told = f"{100 * noise:g} % depth noise" if noise else "Noise-free"
        parts.append(f"## {told}\n\n{_settings_table(numerals, at_noise)}")
    parts.append(f"## Where runs converge from\n\n{_starts_table(final)}")
    if sweep:
        parts.append(f"## Tuning\n\n{_sweep_section(sweep)}")
    if set(numerals) == set(SETTINGS) - {"quick"}:
        parts.append(f"## Floors\n\n{_floors_table(final, numerals, noises)}")
    return "\n".join(parts)


_HOW_TO_READ = f"""
A run starts with every view but the first turned by the given angle about its middle, each by a
random axis of its own; the starts are the same for all methods. It has converged if every view ends
less than {CONVERGED_DEG:g}° and {CONVERGED_PERCENT:g} % of the diameter from the truth. RMS is the
distance of true correspondences over the moved scan, averaged over the pairs of adjacent views and
over the runs that converged, in mm on the scale of the mesh and in % of the object's diameter.
MM-ICC goes by trimmed ICP of contour points in space, and in the last quarter of its renderings by
their distance in the image, which M-ICC goes by throughout. *Joint refinement* is the last step of
the default on its own, from those starts; *default* takes no start at all: scans in, poses out. The
paper gives no unit for its figures, so that a comparison with them is indicative.
"""


def _headline(final: Sequence[Record]) -> str:
    shares = {
        method: _share([r for record in final if _is(record, method) for r in _runs(record)])
        for method in TITLES
    }
    told = [f"{TITLES[m]} from {shares[m]}" for m in ("m-icc", "mm-icc", "joint") if m in shares]
    millimetres = [_rms(record) for record in final if _is(record, "default")]
    return (
        f"**Of all runs, noise-free and not, converged: {', '.join(told)}; the default, without a "
        f"start, in {shares['default']}, with a median RMS of {np.nanmedian(millimetres):.3f} mm.**"
    )


def _settings_table(numerals: Sequence[str], at: Mapping[tuple[str, str], Record]) -> str:
    rows = []
    for numeral in numerals:
        setting = SETTINGS[numeral]
        printed = [f"{value:.3f}" for value in setting.printed or ()] or ["", ""]
        records = [at[numeral, method] for method in TITLES]
        azimuths = ", ".join(f"{a:g}" for a in records[0].result["azimuths_deg"])
        rows.append(
            [
                f"{setting.title} ({azimuths}°)",
                *printed,
                *(f"{_share(_runs(record))}: {_rms_cell(record)}" for record in records),
            ]
        )
    headings = ["setting (azimuths)", "paper, M-ICC", "paper, proposed"]
    headings += [f"{title}: converged, RMS mm (%)" for title in TITLES.values()]
    return markdown_table(headings, rows)


def _starts_table(final: Sequence[Record]) -> str:
    starts = [*(degrees for degrees, _ in STARTS), "coarse"]
    rows = [
        [TITLES[method], *(_share(_from(final, method, start)) for start in starts)]
        for method in ("m-icc", "mm-icc", "joint")
    ]
    headings = ["converged", *(f"{start}° off" for start, _ in STARTS), "published coarse pose"]
    return (
        "All settings, noise-free and not. The published coarse pose counts where it is right "
        f"(< {COARSE_DEG:g}°, < {COARSE_PERCENT:g} %) for every view of a setting.\n\n"
        + markdown_table(headings, rows)
    )


def _from(final: Sequence[Record], method: str, start: float | str) -> list[Mapping[str, Any]]:
    of_method = [run for record in final if _is(record, method) for run in _runs(record)]
    return [run for run in of_method if run["start"] == start]


def _sweep_section(sweep: Sequence[Record]) -> str:
    numerals = list(dict.fromkeys(record.unit["setting"] for record in sweep))
    rows, lines = [], []
    for method in SWEEP:
        counts = {
            tuning: [_count(_find(sweep, method, tuning, numeral)) for numeral in numerals]
            for tuning in dict.fromkeys(_tuning(r) for r in sweep if _is(r, method))
        }
        best = max(counts, key=lambda tuning: sum(counts[tuning]))
        used = (TUNED[method]["tau"], TUNED[method]["renders"], TUNED[method]["trim"])
        for tuning, converged in counts.items():
            cells = [_tuning_title(method, tuning), *map(str, converged), str(sum(converged))]
            rows.append([f"**{cell}**" for cell in cells] if tuning == used else cells)
        most = [max(column) for column in zip(*counts.values(), strict=True)]
        rows.append([f"{TITLES[method]}, best of each", *map(str, most), str(sum(most))])
        is_best = sum(counts[best]) == sum(counts[used])
        told = "no other does better" if is_best else f"{_tuning_title(method, best)} does better"
        lines.append(f"{TITLES[method]} takes the bold setting; {told}.")
    num = sweep[0].unit["seeds"]
    head = (
        f"Converged of {num} noise-free runs from {SWEEP_DEG}° off, one change at a time from the "
        "middle: tau_1 = tau_2 in pixels, renderings, share of the matches that trimmed ICP keeps "
        "(M-ICC's mutual matches are not trimmed). One setting serves all seven; the best of each "
        f"setting stands below. {' '.join(lines)}\n\n"
    )
    return head + markdown_table(["tuning", *(f"({n})" for n in numerals), "all"], rows)


def _find(
    sweep: Sequence[Record], method: str, tuning: tuple[Any, ...], numeral: str
) -> list[Mapping[str, Any]]:
    return [
        run
        for record in sweep
        if _is(record, method) and _tuning(record) == tuning and record.unit["setting"] == numeral
        for run in _runs(record)
    ]


def _tuning(record: Record) -> tuple[Any, ...]:
    return tuple(record.unit[key] for key in ("tau", "renders", "trim"))


def _tuning_title(method: str, tuning: tuple[Any, ...]) -> str:
    tau, renders, trim = tuning
    kept = "" if method == "m-icc" else f", {'auto' if trim is None else f'{trim:g}'}"
    return f"{TITLES[method]} {tau:g} px, {renders}{kept}"


ICCS = ("mm-icc", "m-icc")
COMPLEX = ("ii", "iii", "v", "vi", "vii")
"""Where the paper says that M-ICC gives in."""


def _floors_table(final: Sequence[Record], numerals: Sequence[str], noises: Sequence[float]) -> str:
    rows = []
    for noise in noises:
        at = {
            (record.unit["setting"], record.unit["method"]): record
            for record in final
            if record.unit["noise"] == noise
        }
        gain = {n: _count(_runs(at[n, "mm-icc"])) - _count(_runs(at[n, "m-icc"])) for n in numerals}
        rms = {n: {method: _rms(at[n, method]) for method in TITLES} for n in numerals}
        told = {n: " against ".join(_share(_runs(at[n, m])) for m in ICCS) for n in numerals}
        checks: dict[str, list[str]] = {
            "MM-ICC converges at least as often as M-ICC": [
                f"{n} ({told[n]})" for n in numerals if gain[n] < 0
            ],
            f"and more often in {', '.join(COMPLEX)}": [
                f"{n} ({told[n]})" for n in COMPLEX if gain[n] <= 0
            ],
            "the default's RMS is below that of M-ICC and MM-ICC": [
                n
                for n in numerals
                if not rms[n]["default"] < min(rms[n]["m-icc"], rms[n]["mm-icc"])
            ],
            "and below the paper's, read as mm": [
                n for n in numerals if not rms[n]["default"] < (SETTINGS[n].printed or (0, 0))[1]
            ],
        }
        rows += [
            [
                f"{100 * noise:g} %",
                claim,
                "pass" if not failing else f"**FAIL** in {', '.join(failing)}",
            ]
            for claim, failing in checks.items()
        ]
    return markdown_table(["noise", "what must hold", ""], rows)


def _is(record: Record, method: str) -> bool:
    return record.unit["method"] == method


def _runs(record: Record) -> list[Mapping[str, Any]]:
    return record.result["runs"]


def _converged(run: Mapping[str, Any]) -> bool:
    """A run without errors did not place all views."""
    return "rotation_deg" in run and is_converged(run["rotation_deg"], run["translation_percent"])


def _count(runs: Sequence[Mapping[str, Any]]) -> int:
    return sum(_converged(run) for run in runs)


def _share(runs: Sequence[Mapping[str, Any]]) -> str:
    return f"{_count(runs)}/{len(runs)}"


def _rms_percent(record: Record) -> float:
    """Mean RMS of the runs that converged, in % of the diameter; NaN if none did."""
    right = [run["rms_percent"] for run in _runs(record) if _converged(run)]
    return float(np.mean(right)) if right else float("nan")


def _rms(record: Record) -> float:
    """The same in the unit of the mesh: mm."""
    return _rms_percent(record) * record.result["diameter"] / 100


def _rms_cell(record: Record) -> str:
    percent = _rms_percent(record)
    return "-" if np.isnan(percent) else f"{_rms(record):.3f} ({percent:.3f})"
