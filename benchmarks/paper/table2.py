"""Table 2: M-ICC, MM-ICC and the default in the paper's seven settings."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks.paper.pages import markdown_table
from benchmarks.paper.settings import (
    CONVERGED_DEG,
    CONVERGED_PERCENT,
    SETTINGS,
    Setting,
    azimuths_of,
    is_converged,
    outcome,
    scans_of,
    start_poses,
    true_poses,
)
from benchmarks.paper.study import Record, Unit
from benchmarks.paper.views import VirtualScan, pose_error
from scanweld.config import Config, ContoursConfig, FusionConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.contours.m_icc import m_icc
from scanweld.contours.mm_icc import mm_icc
from scanweld.geometry.pose import Pose
from scanweld.heat.features import describe
from scanweld.multiview.refine import refine_poses
from scanweld.pairs.coarse import register_as_published
from scanweld.pipeline import run

NAME = "table2"
TITLE = "Table 2: refinement in seven settings"

Method = Literal["m-icc", "mm-icc", "joint", "default"]

TITLES: dict[str, str] = {
    "m-icc": "M-ICC",
    "mm-icc": "MM-ICC",
    "joint": "joint refinement",
    "default": "default",
}
START_DEG = (10, 20, 40)
NUM_SEEDS = 8
SWEEP_DEG = 40
"""The tuning is chosen by the hardest starts: from the others nearly all runs converge."""
NOISES = (0.0, 0.001)
"""Standard deviation of the depth, in diameters."""
NUM_DEFAULT_DRAWS = 3
"""The default takes no start: only noise makes its runs differ."""
COARSE_DEG, COARSE_PERCENT = 5.0, 2.0
"""A coarse pose is right within these."""

Tuning = Mapping[str, float | int | None]
CENTRE: dict[str, Tuning] = {
    "m-icc": {"tau": 3.0, "renders": 20, "trim": None},
    "mm-icc": {"tau": 5.0, "renders": 40, "trim": 0.9},
}
"""What the sweep changes one thing of at a time: tau_1 = tau_2 in pixels, renderings, and the share
of matches kept (found anew if None; M-ICC's mutual matches are not trimmed)."""
SWEEP: dict[str, tuple[Tuning, ...]] = {
    "m-icc": tuple(
        {**CENTRE["m-icc"], **change}
        for change in ({}, {"tau": 5.0}, {"tau": 10.0}, {"renders": 10}, {"renders": 40})
    ),
    "mm-icc": tuple(
        {**CENTRE["mm-icc"], **change}
        for change in (
            *({}, {"tau": 3.0}, {"tau": 10.0}, {"renders": 10}, {"renders": 20}),
            *({"trim": 0.7}, {"trim": None}),
        )
    ),
}
TUNED: dict[str, Tuning] = CENTRE
"""What the sweep found best over all seven settings; the page says whether that is still so."""


def units(quick: bool) -> list[Unit]:
    """The sweep of the tuning, and all methods with the tuning that it found."""
    if quick:
        methods = ("m-icc", "mm-icc", "joint", "default")
        return [_final("quick", 0.0, method, seeds=1) for method in methods]
    numerals = [numeral for numeral in SETTINGS if numeral != "quick"]
    sweep = [
        {"part": "sweep", "setting": numeral, "method": method, "seeds": NUM_SEEDS, **tuning}
        for method, tunings in SWEEP.items()
        for tuning in tunings
        for numeral in numerals
    ]
    final = [
        _final(numeral, noise, method, NUM_SEEDS)
        for noise in NOISES
        for method in TITLES
        for numeral in numerals
    ]
    return [*sweep, *final]


def _final(numeral: str, noise: float, method: str, seeds: int) -> Unit:
    unit = {"part": "final", "setting": numeral, "noise": noise, "method": method, "seeds": seeds}
    return {**unit, **TUNED.get(method, {})}


def measure(unit: Unit) -> dict[str, Any]:
    """Errors from all starts of a setting, for one method and tuning."""
    setting = SETTINGS[unit["setting"]]
    if unit["method"] == "default":
        runs = _default_runs(setting, unit)
    elif unit["part"] == "sweep":
        runs = [_run(setting, unit, SWEEP_DEG, seed) for seed in range(unit["seeds"])]
    else:
        starts = [(degrees, seed) for degrees in START_DEG for seed in range(unit["seeds"])]
        runs = [_run(setting, unit, *start) for start in starts]
        runs += _coarse_runs(setting, unit)
    return {
        "azimuths_deg": azimuths_of(setting),
        "diameter": scans_of(setting)[0].diameter,
        "runs": runs,
    }


def _run(setting: Setting, unit: Unit, degrees: float, seed: int) -> dict[str, Any]:
    scans = scans_of(setting, unit.get("noise", 0.0), seed)
    found = _refined(setting, scans, start_poses(scans, degrees, seed), unit)
    return {"start": degrees, "seed": seed, **asdict(outcome(scans, setting.edges, found))}


def _refined(
    setting: Setting, scans: Sequence[VirtualScan], start: Mapping[int, Pose], unit: Unit
) -> Mapping[int, Pose]:
    prepared = [scan.scan for scan in scans]
    if unit["method"] == "joint":
        config = Config()
        matcher = contour_matcher(prepared, config.contours)
        return refine_poses(prepared, start, setting.edges, config.refine, matcher).poses
    config = ContoursConfig(
        jump_pixels=unit["tau"], num_renders=unit["renders"], trim=unit["trim"], residual="point"
    )
    method = m_icc if unit["method"] == "m-icc" else mm_icc
    return method(prepared, start, setting.edges, config).poses


def _coarse_runs(setting: Setting, unit: Unit) -> list[dict[str, Any]]:
    """From the coarse poses as published; none where one of them is wrong."""
    scans = scans_of(setting, unit["noise"])
    start = _coarse_poses(setting, unit["noise"])
    if start is None:
        return []
    found = _refined(setting, scans, start, unit)
    return [{"start": "coarse", "seed": 0, **asdict(outcome(scans, setting.edges, found))}]


@lru_cache
def _coarse_poses(setting: Setting, noise: float) -> dict[int, Pose] | None:
    """Poses by the published coarse step along the views; None if it puts one of them wrong."""
    config, scans = Config(), scans_of(setting, noise)
    features = [describe(scan.scan, config.heat) for scan in scans]
    poses = {0: Pose.identity()}
    for k in range(1, len(scans)):
        i, j = scans[k - 1], scans[k]
        found = register_as_published(
            i.scan, j.scan, features[k - 1], features[k], config.coarse
        ).i_from_j
        if found is None:
            return None
        poses[k] = poses[k - 1] @ found
        rotation, shift = pose_error(true_poses(scans)[k], poses[k], j.centre(), j.diameter)
        if rotation > COARSE_DEG or shift > COARSE_PERCENT:
            return None
    return poses


def _default_runs(setting: Setting, unit: Unit) -> list[dict[str, Any]]:
    """Scans in, poses out; a view that is not placed counts as not converged."""
    runs = []
    config = Config(fusion=FusionConfig(max_voxels_across=50))
    for draw in range(NUM_DEFAULT_DRAWS if unit["noise"] else 1):
        scans = scans_of(setting, unit["noise"], draw)
        found = run([scan.scan.scan for scan in scans], config, workers=1)
        poses = [found.poses.get(scan.scan.name) for scan in scans]
        placed = {k: pose for k, pose in enumerate(poses) if pose is not None}
        together = len(found.components) == 1 and len(placed) == len(scans)
        errors = asdict(outcome(scans, setting.edges, placed)) if together else {}
        runs.append({"start": "none", "seed": draw, **errors})
    return runs


def page(records: Sequence[Record], out: Path) -> str:
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
*Joint refinement* is the last step of the default on its own, from those starts; *default* takes no
start at all: scans in, poses out. The paper gives no unit for its figures, so that a comparison
with them is indicative.
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
    starts = [*START_DEG, "coarse"]
    rows = [
        [TITLES[method], *(_share(_from(final, method, start)) for start in starts)]
        for method in ("m-icc", "mm-icc", "joint")
    ]
    headings = ["converged", *(f"{start}° off" for start in START_DEG), "published coarse pose"]
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
