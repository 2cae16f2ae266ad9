"""Pages of the study: for each a template, and the pictures on it."""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from importlib import import_module
from operator import or_
from pathlib import Path

import numpy as np

from benchmarks.blocks import TEMPLATES, rendered
from benchmarks.paper import methods, pictures, settings, summary
from benchmarks.paper.methods import BY_TITLE, METHODS, missing_modules
from benchmarks.study.plots import Curve, Panel, draw_panels
from benchmarks.study.records import Records, answers, by_overlap, grouped, of, values_of
from benchmarks.study.study import Record
from scanweld.io.atomic import write_whole


def write_page(name: str, records: Sequence[Record], out: Path, *, quick: bool) -> str:
    """Write the page of a table of the study, and the pictures on it; what it says.

    The template sees ``records`` and all names of the settings, of the module that measures the
    table, and of the summary.
    """
    out.mkdir(parents=True, exist_ok=True)
    DRAW.get(name, lambda records, out: None)(records, out)
    command = f"python -m benchmarks.paper --only {name}" + (" --quick" if quick else "")
    page = {
        "wrote": f"`{command}` wrote this page and [the records](data/{name}.json) behind it.",
        "missing": sorted(missing_modules()) if quick else [],
        "records": records,
    }
    measuring = import_module(f"benchmarks.paper.{name}")
    values = [vars(pictures), vars(methods), vars(settings), vars(measuring), vars(summary), page]
    text = rendered(f"paper/{name}", **reduce(or_, values)).rstrip() + "\n"
    write_whole(out / f"{name}.md", text.encode())
    return text


def write_index(names: Sequence[str], out: Path) -> None:
    """Write the list of the pages that stand."""
    titles = {name: _title(name) for name in names if (out / f"{name}.md").exists()}
    write_whole(out / "README.md", rendered("paper/README", titles=titles).encode())


def _title(name: str) -> str:
    assert TEMPLATES.loader is not None
    template = TEMPLATES.loader.get_source(TEMPLATES, f"paper/{name}.md.j2")[0]
    return template.partition("\n")[0].removeprefix("# ")


def _draw_table1(records: Records, out: Path) -> None:
    """Share of right answers against the gap, a panel for each kind of start."""
    panels = []
    for protocol, chosen in grouped(of(records, noise=0.0), "{protocol}").items():
        gaps = grouped(chosen, "{gap}")
        ticks = {int(gap): gap for gap in gaps}
        panels.append(Panel(summary.STARTS_OF[protocol], ticks, _curves(list(gaps.values()))))
    draw_panels(out / "table1.png", [panels], "gap between the views (°)", "right answers (%)")


def _draw_real_pairs(records: Records, out: Path) -> None:
    """Share of pairs in the right basin by overlap."""
    bins = by_overlap(records, summary.BINS[::-1])
    titles = [f"{title}\n{len(inside)} pairs" for title, inside in bins.items()]
    panel = Panel("", dict(enumerate(titles)), _curves(list(bins.values()), in_basin=True))
    draw_panels(out / "real_pairs.png", [[panel]], "overlap", f"right answers, {summary.BASIN} (%)")


def _curves(groups: Sequence[Records], *, in_basin: bool = False) -> dict[str, Curve]:
    """A line for each method, over groups of pairs."""
    curves = {}
    for title, method in BY_TITLE.items():
        limit = summary.RIGHT if method in summary.REFINED and not in_basin else summary.BASIN
        shares = [limit.share(answers(group, method)) for group in groups]
        curves[title] = shares, _look(method in ("default", "paper"), METHODS[method].color)
    return curves


def _look(is_strong: bool, color: str) -> dict[str, object]:
    return {"color": color, **({"linewidth": 2.6, "zorder": 3} if is_strong else {})}


def _draw_basins(records: Records, out: Path) -> None:
    """Share of right answers against the start, a panel for each gap."""
    starts, methods = records[0].result["answers"], summary.from_starts(records)
    colors = {name: entry.color for name, entry in METHODS.items()} | {"joint": "#9C6ADE"}
    panels = []
    for title, at_gap in grouped(records, "views {gap}° apart").items():
        curves = {}
        for n, (name, method) in enumerate(methods.items()):
            each = [summary.answers_from(at_gap, start, method) for start in starts]
            # Curves that coincide are drawn a hair apart, so that all are seen.
            offset = 0.007 * (n - len(methods) / 2)
            look = _look(method in ("m-icc", "mm-icc", "default"), colors[method])
            look["linestyle"] = "--" if method == "default" else "-"
            curves[name] = [settings.CONVERGED.share(some) + offset for some in each], look
        panels.append(Panel(title, {int(start): start for start in starts}, curves))
    draw_panels(out / "basins.png", [panels], "start, degrees off", "right poses (%)")


def _draw_features(records: Records, out: Path) -> None:
    """Shares against the gap, chance dashed; a row an object."""
    rows = [
        [_feature_panel(f"{name}: {title}", own, *asked) for title, asked in _PLOTTED.items()]
        for name, own in grouped(records, "{object}").items()
    ]
    draw_panels(out / "features.png", rows, "gap (°)", "share (%), by chance dashed")


def _feature_panel(title: str, records: Records, group: str, question: str) -> Panel:
    gaps, curves = values_of(records, "gap"), {}
    for entry in records[0].result[group]:
        each = [summary.pooled(of(records, gap=gap), group, question, entry) for gap in gaps]
        right, asked, chance = np.array(each).T
        asked, look = np.where(asked > 0, asked, np.nan), {"color": _COLORS[entry]}
        curves[entry] = right / asked, look
        curves[f"_{entry} by chance"] = chance / asked, {**look, "linestyle": "--"}
    return Panel(title, {gap: str(gap) for gap in gaps}, curves)


_PLOTTED = {
    "repeated keypoints": ("detectors", "repeated"),
    "right mutual matches, own keypoints": ("own", "mutual"),
    "same, evenly spread": ("even", "mutual"),
}
_COLORS = {
    **{"PA-HKS": "#c0392b", "SI-HKS": "#e67e22", "WKS": "#b7950b", "HKS, full mesh": "#7f8c8d"},
    **{"FPFH": "#2471a3", "3D Harris": "#2471a3", "random points": "#555555"},
}
DRAW: Mapping[str, Callable[[Records, Path], None]] = {
    "table1": _draw_table1,
    "real_pairs": _draw_real_pairs,
    "features": _draw_features,
    "basins": _draw_basins,
    "figures": pictures.draw,
}
