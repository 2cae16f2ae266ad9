"""The page of Table 1: what its records say, in words, tables and a plot."""

from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.paper.lines import ORDER, draw_shares, dress
from benchmarks.paper.methods import METHODS
from benchmarks.paper.optional import need
from benchmarks.paper.pages import markdown_table, percent
from benchmarks.paper.study import Record
from benchmarks.paper.success import Limit, Told, cell, share_right

RIGHT = Limit(deg=1, percent=1)
BASIN = Limit(deg=5, percent=2)
LIMIT_OF = {"paper-coarse": BASIN}
"""What is not refined cannot be held to the tight limit."""
PRINTED = {
    "M-ICC": ("< 1", "< 1", "< 1", "< 1", "< 1", "< 1", "58", "58", "62"),
    "Proposed": ("< 1",) * 9,
}
"""The paper's Table 1, rotation error in degrees at gaps 10 to 90."""
NEAR_GAP = 90
"""To this gap every pair must be right; beyond it the overlap says what can be asked."""
OVERLAPS = ((0.15, 1.01, 0.95), (0.10, 0.15, 0.80), (0.0, 0.10, None))
"""From, below, and the share of pairs that must be right there."""
PROTOCOL_TITLES = {"identity": "the paper's start", "random": "any start"}
_PLOT = "table1.png"


def tell(records: Sequence[Record], out: Path) -> str:
    """The page as Markdown; its plot goes to the folder ``out``."""
    _plot([r for r in records if not r.unit["noise"]], out / _PLOT)
    parts = [
        _introduction(records),
        f"![Share of right answers against the gap]({_PLOT})\n",
        "## What it must show\n",
        _floors(records),
        "## In the paper's form\n",
        _paper_form(records),
        "## The published coarse step\n",
        _published(records),
        "## Beyond the gap of a right angle, by overlap\n",
        _by_overlap(records),
        "## All gaps\n",
        *_all_gaps(records),
        "## CPU seconds a pair\n",
        _seconds(records),
    ]
    return "\n".join(parts)


def _introduction(records: Sequence[Record]) -> str:
    noise = max(r.unit["noise"] for r in records)
    missing = sorted({module for r in records for module in r.unit.get("missing", ())})
    left_out = (
        f"\nNot installed, and the methods that need them left out: {', '.join(missing)}.\n"
        if missing
        else ""
    )
    noisy = f" Noise of {percent_of(noise)} of the diameter grows towards grazing rays." * (
        noise > 0
    )
    return f"""\
Two virtual scans of {" and ".join(_objects(records))}, 240 pixels across the diameter, from cameras
on a circle; the gap is the angle between them. *The paper's start*: neither camera is rolled, and
both scans start in their own camera frames. *Any start*: the second camera is rolled at random, and
the second scan starts turned by a random rotation, its middle on that of the first. Methods of
libraries that make nothing of the start are tried from any start only.{noisy}

An answer is *right* if it is less than 1° and, at the middle of the second scan, less than 1 % of
the object's diameter off ({LIMIT_OF["paper-coarse"]} for the coarse step, which nothing refines).
Cells say how many of the pairs are right, and the median rotation error of these in degrees.
{left_out}"""


def percent_of(share: float) -> str:
    """A small share as a percentage."""
    return f"{100 * share:g} %"


def _floors(records: Sequence[Record]) -> str:
    """Floors of the default, and the pairs that miss them."""
    rows, failing = [], []
    for noise in _noises(records):
        chosen = [r for r in records if r.unit["noise"] == noise]
        for protocol, name in product(_protocols(chosen), _objects(chosen)):
            near = [
                r
                for r in _of(chosen, object=name, protocol=protocol)
                if r.unit["gap"] <= NEAR_GAP and "default" in r.result["answers"]
            ]
            wrong = [r for r in near if not RIGHT.holds(r.result["answers"]["default"])]
            if not near:
                continue
            asked = f"{name}, {PROTOCOL_TITLES[protocol]}, to {NEAR_GAP}°, {_noise_title(noise)}"
            rows.append(_floor_row(asked, len(near), len(wrong), 1.0))
            failing += wrong
        far = [r for r in _of(chosen, protocol="random") if r.unit["gap"] > NEAR_GAP]
        for low, high, floor in OVERLAPS:
            inside = [r for r in far if low <= r.result["overlap"] < high]
            wrong = [r for r in inside if not RIGHT.holds(r.result["answers"]["default"])]
            if floor is not None and inside:
                asked = f"beyond {NEAR_GAP}°, overlap {_range(low, high)}, {_noise_title(noise)}"
                rows.append(_floor_row(asked, len(inside), len(wrong), floor))
                failing += wrong
    table = markdown_table(("default", "right", "floor", ""), rows)
    return table + _failing(failing)


def _floor_row(asked: str, number: int, num_wrong: int, floor: float) -> tuple[str, ...]:
    is_met = number - num_wrong >= floor * number
    right = f"{number - num_wrong}/{number}"
    return asked, right, percent(floor), "pass" if is_met else "**FAIL**"


def _failing(records: Sequence[Record]) -> str:
    if not records:
        return "\nNo pair under these floors is wrong.\n"
    rows = [
        (
            f"{r.unit['object']} {r.unit['azimuth']}° and {r.unit['azimuth'] + r.unit['gap']}°",
            PROTOCOL_TITLES[r.unit["protocol"]],
            _noise_title(r.unit["noise"]),
            f"{r.result['overlap']:.2f}",
            _error(r.result["answers"]["default"]),
            "yes" if r.result["answers"]["default"].get("accepted") else "no",
        )
        for r in records
    ]
    headings = ("pair", "start", "noise", "overlap", "error of the default", "accepted")
    return "\nThe pairs under these floors that are wrong:\n\n" + markdown_table(headings, rows)


def _paper_form(records: Sequence[Record]) -> str:
    """Median rotation error of all azimuths, right or wrong, as the paper prints one number."""
    clean = _of(records, noise=0.0)
    gaps = [g for g in _gaps(clean) if g <= NEAR_GAP]
    rows = []
    if gaps == list(range(10, 100, 10)):
        rows += [(f"the paper: {name}", "", *values) for name, values in PRINTED.items()]
    asked = (("m-icc", "identity"), ("paper", "identity"), ("default", "identity"))
    for name, (method, protocol) in product(
        _objects(clean), (*asked, ("paper", "random"), ("default", "random"))
    ):
        chosen = _answers(_of(clean, object=name, protocol=protocol), method)
        if chosen:
            cells = (_median_degrees([t for g, t in chosen if g == gap]) for gap in gaps)
            title = f"{METHODS[method].title}, {PROTOCOL_TITLES[protocol]}"
            rows.append((title, name, *cells))
    text = """\
Rotation error in degrees; ours are medians over all azimuths, the wrong ones included. The paper
names neither its object nor its azimuth, and starts every pair as in *the paper's start*.

"""
    return text + markdown_table(("", "object", *(f"{gap}°" for gap in gaps)), rows)


def _published(records: Sequence[Record]) -> str:
    """What eq. 1 matches at each gap, and what becomes of it."""
    known = [r for r in records if "matches" in r.result]
    rows = []
    for gap in _gaps(known):
        at_gap = [r for r in known if r.unit["gap"] == gap]
        total = {
            key: sum(r.result["matches"][key] for r in at_gap)
            for key in ("keypoints", "matched", "right", "by_chance")
        }
        matched = max(total["matched"], 1)
        shares = [
            percent(share_right(_told(at_gap, method), limit)) if _told(at_gap, method) else "-"
            for method, limit in (("paper-coarse", BASIN), ("paper", BASIN), ("paper", RIGHT))
        ]
        mean = f"{total['matched'] / len(at_gap):.1f}"
        rows.append(
            (
                f"{gap}°",
                f"{total['keypoints'] / len(at_gap):.0f}",
                mean,
                percent(total["right"] / matched),
                percent(total["by_chance"] / matched),
                *shares,
            )
        )
    headings = (
        *("gap", "keypoints", "matches of eq. 1", "of these right", "right by chance"),
        *(f"coarse pose {BASIN}", f"after MM-ICC {BASIN}", f"after MM-ICC {RIGHT}"),
    )
    text = """\
From the paper's start, without noise. Eq. 1 gives each PA-HKS keypoint its nearest signature and
refuses those above the threshold; a match is right if its two places lie within 5 % of the diameter
on the object. By chance: if each of these keypoints were matched with any of the other scan.

"""
    return text + markdown_table(headings, rows) + _published_words(known)


def _published_words(records: Sequence[Record]) -> str:
    """Where the published recipe breaks, said in words."""
    coarse = _told(records, "paper-coarse")
    if not coarse:
        return ""
    wide = [r for r in records if r.unit["gap"] > 30]
    matched = sum(r.result["matches"]["matched"] for r in wide)
    right = sum(r.result["matches"]["right"] for r in wide) / max(matched, 1)
    by_chance = sum(r.result["matches"]["by_chance"] for r in wide) / max(matched, 1)
    gone_in = [
        told
        for r, told in zip(records, coarse, strict=True)
        if BASIN.holds(told) and "paper" in r.result["answers"]
    ]
    finished = [
        r.result["answers"]["paper"]
        for r, told in zip(records, coarse, strict=True)
        if BASIN.holds(told)
    ]
    fine = (
        f" Of the {len(gone_in)} coarse poses in the basin MM-ICC makes "
        f"{sum(RIGHT.holds(told) for told in finished)} right."
        if gone_in
        else ""
    )
    return (
        f"\nBeyond 30° {percent(right)} of the matches are right, where chance gives "
        f"{percent(by_chance)}. {sum(BASIN.holds(t) for t in coarse)} of {len(coarse)} coarse "
        f"poses lie in the basin.{fine}\n"
    )


def _by_overlap(records: Sequence[Record]) -> str:
    far = [r for r in records if r.unit["gap"] > NEAR_GAP and r.unit["protocol"] == "random"]
    if not far:
        return f"No pair here is more than {NEAR_GAP}° apart.\n"
    rows = []
    for noise, method in product(_noises(far), ORDER):
        chosen = _of(far, noise=noise)
        bins = [
            [r for r in chosen if low <= r.result["overlap"] < high] for low, high, _ in OVERLAPS
        ]
        if _told(chosen, method):
            limit = LIMIT_OF.get(method, RIGHT)
            cells = (cell(_told(inside, method), limit) for inside in bins)
            rows.append((METHODS[method].title, _noise_title(noise), *cells))
    headings = ("any start", "noise", *(f"overlap {_range(a, b)}" for a, b, _ in OVERLAPS))
    return markdown_table(headings, rows)


def _all_gaps(records: Sequence[Record]) -> Iterable[str]:
    for noise, protocol, name in product(_noises(records), _protocols(records), _objects(records)):
        chosen = _of(records, noise=noise, protocol=protocol, object=name)
        if not chosen:
            continue
        gaps = _gaps(chosen)
        rows = []
        for method in ORDER:
            told = _answers(chosen, method)
            if told:
                limit = LIMIT_OF.get(method, RIGHT)
                cells = (cell([t for g, t in told if g == gap], limit) for gap in gaps)
                rows.append((METHODS[method].title, *cells))
        yield f"### {name}, {PROTOCOL_TITLES[protocol]}, {_noise_title(noise)}\n"
        yield markdown_table(("", *(f"{gap}°" for gap in gaps)), rows)


def _seconds(records: Sequence[Record]) -> str:
    rows = [
        (METHODS[method].title, f"{np.median([t['seconds'] for t in _told(records, method)]):.2f}")
        for method in ORDER
        if _told(records, method)
    ]
    text = (
        "Median, one core, both scans prepared; features and what else a method needs included.\n\n"
    )
    return text + markdown_table(("", "seconds"), rows)


def _plot(records: Sequence[Record], path: Path) -> None:
    """Share of right answers against the gap, a panel for each kind of start."""
    need("matplotlib").use("Agg")
    from matplotlib import pyplot

    protocols = _protocols(records)
    figure, axes = pyplot.subplots(1, len(protocols), figsize=(11, 4.6), sharey=True, squeeze=False)
    for panel, protocol in zip(axes[0], protocols, strict=True):
        chosen = _of(records, protocol=protocol)
        for method in ORDER:
            told, limit = _answers(chosen, method), LIMIT_OF.get(method, RIGHT)
            gaps = sorted({gap for gap, _ in told})
            shares = [share_right([t for g, t in told if g == gap], limit) for gap in gaps]
            if gaps:
                draw_shares(panel, method, gaps, shares)
        panel.set(title=PROTOCOL_TITLES[protocol], xlabel="gap between the views (°)")
        panel.set_xticks(_gaps(chosen))
        dress(panel)
    axes[0][0].set_ylabel("right answers (%)")
    lines = {
        line.get_label(): line for panel in axes[0] for line in panel.get_legend_handles_labels()[0]
    }
    titles = [METHODS[m].title for m in ORDER if METHODS[m].title in lines]
    handles = [lines[title] for title in titles]
    figure.legend(handles, titles, loc="center right", frameon=False, fontsize=9)
    figure.tight_layout(rect=(0, 0, 0.83, 1))
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _of(records: Iterable[Record], **wanted: object) -> list[Record]:
    return [r for r in records if all(r.unit[key] == value for key, value in wanted.items())]


def _told(records: Iterable[Record], method: str) -> list[Told]:
    return [r.result["answers"][method] for r in records if method in r.result["answers"]]


def _answers(records: Iterable[Record], method: str) -> list[tuple[int, Told]]:
    """Gap and answer of every pair on which a method was tried."""
    tried = [r for r in records if method in r.result["answers"]]
    return [(r.unit["gap"], r.result["answers"][method]) for r in tried]


def _objects(records: Iterable[Record]) -> list[str]:
    return list(dict.fromkeys(r.unit["object"] for r in records))


def _protocols(records: Iterable[Record]) -> list[str]:
    return list(dict.fromkeys(r.unit["protocol"] for r in records))


def _noises(records: Iterable[Record]) -> list[float]:
    return sorted({r.unit["noise"] for r in records})


def _gaps(records: Iterable[Record]) -> list[int]:
    return sorted({r.unit["gap"] for r in records})


def _noise_title(noise: float) -> str:
    return f"noise {percent_of(noise)}" if noise else "no noise"


def _range(low: float, high: float) -> str:
    if high > 1:
        return f"from {low:.2f}"
    return f"{low:.2f}-{high:.2f}" if low else f"below {high:.2f}"


def _median_degrees(told: Sequence[Told]) -> str:
    """As the paper prints it: "< 1", or whole degrees; 180 where there is no answer."""
    degrees = [180.0 if each["deg"] is None else each["deg"] for each in told]
    if not degrees:
        return ""
    middle = float(np.median(degrees))
    return "< 1" if middle < 1 else f"{middle:.0f}"


def _error(told: Told) -> str:
    return "no answer" if told["deg"] is None else f"{told['deg']:.1f}°, {told['percent']:.1f} %"
