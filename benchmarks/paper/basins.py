"""Basins of convergence: how far from the truth a method may start."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper.methods import METHODS, ScanPair
from benchmarks.paper.optional import need
from benchmarks.paper.pages import markdown_table
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.success import Limit, cell, share_right
from benchmarks.paper.trial import need_all, try_methods
from benchmarks.paper.views import VirtualScan, disturbed, mesh_of, pose_error, virtual_scan
from scanweld.config import Config
from scanweld.contours.coherence import contour_matcher
from scanweld.geometry.pose import Pose
from scanweld.refinement.refine import refine_poses

NAME = "basins"
TITLE = "Basins of convergence"

OBJECTS = ("armadillo", "bunny")
GAPS = (30, 60, 90)
AZIMUTHS = tuple(range(0, 360, 45))
START_DEG = (2, 5, 10, 20, 30, 40)
FROM_A_START = ("icp", "trimmed-icp", "gicp", "point-to-plane", "m-icc", "mm-icc")
JOINT, DEFAULT = "joint", "default"
TITLES = {
    **{name: METHODS[name].title for name in FROM_A_START},
    JOINT: "joint refinement",
    DEFAULT: "default",
}
QUICK_METHODS = ("icp", "trimmed-icp", "m-icc", "mm-icc")
CONVERGED = Limit(deg=2.0, percent=1.0)
COLORS = dict(
    zip(
        TITLES,
        ("#b0b0b0", "#7a7a7a", "#76b7b2", "#59a14f", "#edc948", "#e15759", "#9c6ade", "#2471a3"),
        strict=True,
    )
)


def units(quick: bool) -> list[Unit]:
    """One unit a pair of views; every azimuth has a random axis of its own.

    Raises:
        InputError: If a mesh or a library is missing.
    """
    if quick:
        starts = {"starts": [5, 20, 40], "methods": QUICK_METHODS}
        return [{"object": "creature", "gap": 60, "azimuth": a, **starts} for a in (0, 135)]
    need_all(FROM_A_START)
    for name in OBJECTS:
        mesh_of(name)
    return [
        {"object": name, "gap": gap, "azimuth": azimuth, "starts": START_DEG}
        for name, gap, azimuth in product(OBJECTS, GAPS, AZIMUTHS)
    ]


def measure(unit: Unit) -> Result:
    """What all methods make of a pair, from poses farther and farther from the truth."""
    azimuth = unit["azimuth"]
    i, j = (virtual_scan(unit["object"], float(a)) for a in (azimuth, azimuth + unit["gap"]))
    pair = ScanPair(i=i.scan, j=j.scan, diameter=(i.scan.diameter + j.scan.diameter) / 2)
    true, methods = i.from_other(j), unit.get("methods", FROM_A_START)
    answers: dict[str, dict[str, Any]] = {}
    for degrees in unit["starts"]:
        start = disturbed(true, j.centre(), degrees, azimuth)
        tried = try_methods(methods, pair, start, true, i.diameter, azimuth)
        told = {name: _errors(answer) for name, answer in tried.items()}
        answers[str(degrees)] = {**told, JOINT: _jointly_refined(i, j, start)}
    without_start = try_methods([DEFAULT], pair, true, true, i.diameter, azimuth)
    return {"answers": answers, DEFAULT: _errors(without_start[DEFAULT])}


def _errors(answer: Mapping[str, Any]) -> dict[str, Any]:
    return {key: answer[key] for key in ("deg", "percent")}


def _jointly_refined(i: VirtualScan, j: VirtualScan, start: Pose) -> dict[str, float]:
    """The last step of the default on its own."""
    config, scans = Config(), (i.scan, j.scan)
    matcher = contour_matcher(scans, config.contours)
    at_start = {0: Pose.identity(), 1: start}
    poses = refine_poses(scans, at_start, [(0, 1)], config.refine, matcher).poses
    found = poses[0].inverse() @ poses[1]
    degrees, percent = pose_error(i.from_other(j), found, j.centre(), i.diameter)
    return {"deg": degrees, "percent": percent}


def page(records: Sequence[Record], out: Path) -> str:
    """Share of right poses against the start: one plot, and the numbers behind it."""
    gaps = list(dict.fromkeys(record.unit["gap"] for record in records))
    starts = [int(start) for start in records[0].result["answers"]]
    _plot(records, gaps, starts, out / f"{NAME}.png")
    objects = " and ".join(dict.fromkeys(record.unit["object"] for record in records))
    parts = [
        _headline(records, gaps, starts),
        f"![share of right poses against the start]({NAME}.png)\n",
        f"Two views of {objects}; the second starts turned by that angle about its middle, by a "
        f"random axis, another one for each pair. A pose is right if it ends {CONVERGED} of the "
        "diameter from the truth. Noise-free. *Joint refinement* is the last step of the default "
        "on its own: it is made for poses that are nearly right. The *default* takes no start. "
        "Cells: right of all, and the median error of the right ones in degrees.\n",
    ]
    for gap in gaps:
        rows = [
            [TITLES[method], *(cell(_told(records, gap, s, method), CONVERGED) for s in starts)]
            for method in _methods(records)
        ]
        headings = ["method", *(f"{start}° off" for start in starts)]
        parts.append(f"## Gap of {gap}°\n\n{markdown_table(headings, rows)}")
    return "\n".join(parts)


def _headline(records: Sequence[Record], gaps: Sequence[int], starts: Sequence[int]) -> str:
    gap, start = max(gaps), max(starts)
    shares = {m: share_right(_told(records, gap, start, m), CONVERGED) for m in _methods(records)}
    from_a_start = [m for m in shares if m != DEFAULT]
    widest = sorted(from_a_start, key=lambda m: -shares[m])
    told = ", ".join(f"{TITLES[m]} {100 * shares[m]:.0f} %" for m in widest)
    return (
        f"**Views {gap}° apart, started {start}° off, come right by {told}; "
        f"the default, which takes no start, by {100 * shares[DEFAULT]:.0f} %.**\n"
    )


def _methods(records: Sequence[Record]) -> list[str]:
    tried = next(iter(records[0].result["answers"].values()))
    return [name for name in TITLES if name in tried or name == DEFAULT]


def _told(records: Sequence[Record], gap: int, start: int, method: str) -> list[Mapping[str, Any]]:
    """Errors of a method from a start; those of the default are the same from all."""
    results = [record.result for record in records if record.unit["gap"] == gap]
    if method == DEFAULT:
        return [result[DEFAULT] for result in results]
    return [result["answers"][str(start)][method] for result in results]


def _plot(
    records: Sequence[Record], gaps: Sequence[int], starts: Sequence[int], path: Path
) -> None:
    need("matplotlib").use("Agg")
    pyplot = need("matplotlib.pyplot")
    figure, panels = pyplot.subplots(
        1, len(gaps), figsize=(3.9 * len(gaps) + 0.6, 3.8), sharey=True, squeeze=False
    )
    methods = _methods(records)
    for gap, panel in zip(gaps, panels[0], strict=True):
        for n, method in enumerate(methods):
            shares = [share_right(_told(records, gap, s, method), CONVERGED) for s in starts]
            # Curves that coincide are drawn a hair apart, so that all are seen.
            lifted = 100 * np.array(shares) + 0.7 * (n - len(methods) / 2)
            style = {"color": COLORS[method], "label": TITLES[method]}
            heavy = method in ("m-icc", "mm-icc", DEFAULT)
            dashes = "--" if method == DEFAULT else "-"
            width, dot = (2.2, 4.5) if heavy else (1.3, 3.0)
            panel.plot(starts, lifted, dashes, marker="o", ms=dot, lw=width, **style)
        panel.set(title=f"views {gap}° apart", xlabel="start, degrees off", xticks=starts)
        panel.set(ylim=(-5, 107))
        panel.grid(axis="y", color="#e6e6e6", lw=0.8)
        panel.spines[["top", "right"]].set_visible(False)
    panels[0][0].set_ylabel("right poses, %")
    handles, labels = panels[0][0].get_legend_handles_labels()
    columns = (len(methods) + 1) // 2
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False, fontsize=9)
    figure.tight_layout(rect=(0, 0.13, 1, 1))
    figure.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(figure)
