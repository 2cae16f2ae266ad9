"""The page of Table 1: what its records say, in words, floors, tables and a plot."""

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

from benchmarks.paper.lines import ORDER, draw_shares, dress
from benchmarks.paper.methods import METHODS
from benchmarks.paper.optional import need
from benchmarks.paper.pages import markdown_table, percent
from benchmarks.paper.picks import (
    by_gap,
    of,
    overlap_title,
    overlapping,
    sentence_on_missing,
    told_by,
    values,
)
from benchmarks.paper.study import Record
from benchmarks.paper.success import Limit, Told, share_right
from benchmarks.paper.table1_tables import (
    BASIN,
    LIMIT_OF,
    NEAR_GAP,
    OVERLAPS,
    PROTOCOL_TITLES,
    RIGHT,
    SUCCESS,
    all_gaps,
    beyond,
    by_overlap,
    noise_title,
    paper_form,
    published,
    seconds,
    small_percent,
    up_to,
)

M_ICC_GAP = 60
"""To this gap the paper's M-ICC succeeds."""
_PLOT = "table1.png"


def tell(records: Sequence[Record], out: Path) -> str:
    """The page as Markdown; its plot goes to the folder ``out``."""
    _plot(of(records, noise=0.0), out / _PLOT)
    parts = [
        _introduction(records),
        "## What it shows\n",
        _words(of(records, noise=0.0)),
        f"![Share of right answers against the gap]({_PLOT})\n",
        "## What it must show\n",
        _floors(records),
        "## In the paper's form\n",
        paper_form(of(records, noise=0.0)),
        "## The published coarse step\n",
        published(records),
        f"## More than {NEAR_GAP}° apart, by overlap\n",
        by_overlap(records),
        "## All gaps\n",
        *all_gaps(records),
        "## CPU seconds a pair\n",
        seconds(records),
    ]
    return "\n".join(parts)


def _introduction(records: Sequence[Record]) -> str:
    text = f"""\
Two virtual scans of one object ({" or ".join(values(records, "object"))}), 240 pixels across its
diameter, from cameras on a circle; the gap is the angle between them. *The paper's start*: neither
camera is rolled, and both scans start in their own camera frames. *Any start*: the second camera is
rolled at random, and the second scan starts turned by a random rotation, its middle on that of the
first. Methods of libraries that make nothing of the start are tried from any start only.
"""
    noise = max(values(records, "noise"))
    if noise:
        text += (
            f"Noise, where there is any, has a standard deviation of {small_percent(noise)} of the "
            "diameter in depth, and more towards grazing rays; with it fewer methods and azimuths "
            "are tried, and the default from any start only.\n"
        )
    return f"""{text}{sentence_on_missing(records)}
An answer is *right* if it is less than 1° and, at the middle of the second scan, less than 1 % of
the object's diameter off ({LIMIT_OF["paper-coarse"]} for the coarse step, which nothing refines).
Cells say how many of the pairs are right, and the median rotation error of these in degrees; (+1)
is one answer more within {BASIN}, from where a refinement could still put it right.
"""


def _words(records: Sequence[Record]) -> str:
    """What the table shows of scans without noise, counted from the records."""
    parts = [_words_on_any_start(of(records, protocol="random"))]
    as_paper = of(records, protocol="identity")
    if told_by(as_paper, "m-icc"):
        parts.append(_words_on_the_papers_start(as_paper))
    return "\n".join(part for part in parts if part)


def _words_on_any_start(records: Sequence[Record]) -> str:
    if not told_by(records, "default"):
        return ""
    near, far = up_to(records, NEAR_GAP), beyond(records, NEAR_GAP)
    told = f"{_count(near, 'default')} pairs to {NEAR_GAP}°"
    told += f" and {_count(far, 'default')} beyond" if far else ""
    text = f"From any start and without noise the default is right in {told}."
    others = [m for m in ORDER if m not in ("default", *LIMIT_OF) and told_by(records, m)]
    if others:
        best = max(others, key=lambda method: share_right(told_by(records, method), RIGHT))
        told = _count(near, best) + (f" and {_count(far, best)}" if far else "")
        text += f" Of the others {METHODS[best].title} does best: {told}."
    return text + "\n"


def _words_on_the_papers_start(records: Sequence[Record]) -> str:
    parts = {
        f"to {M_ICC_GAP}°": up_to(records, M_ICC_GAP),
        f"from there to {NEAR_GAP}°": beyond(up_to(records, NEAR_GAP), M_ICC_GAP),
    }
    told = [
        f"{where} {_count(inside, 'm-icc')} by M-ICC, {_count(inside, 'mm-icc')} by MM-ICC alone "
        f"and {_count(inside, 'paper')} by the whole published method"
        for where, inside in parts.items()
        if inside
    ]
    return (
        f"From the paper's start there are right: {'; '.join(told)}. The paper prints errors below "
        f"1° to {M_ICC_GAP}° for M-ICC, and to {NEAR_GAP}° for its own method.\n"
    )


def _count(records: Sequence[Record], method: str) -> str:
    told = told_by(records, method)
    return f"{sum(RIGHT.holds(each) for each in told)} of {len(told)}"


def _floors(records: Sequence[Record]) -> str:
    """Floors of the default, and the pairs that miss them."""
    rows: list[tuple[str, ...]] = []
    missed: list[Record] = []
    for asked, chosen, limit, floor in _asked(records):
        tried = [r for r in chosen if "default" in r.result["answers"]]
        wrong = [r for r in tried if not limit.holds(r.result["answers"]["default"])]
        if tried:
            num_right = len(tried) - len(wrong)
            verdict = "pass" if num_right >= floor * len(tried) else "**FAIL**"
            rows.append((asked, str(limit), f"{num_right}/{len(tried)}", percent(floor), verdict))
            missed += [r for r in wrong if r not in missed]
    table = markdown_table(("default", "error", "pairs", "floor", ""), rows)
    return table + _those_missed(missed)


def _asked(records: Sequence[Record]) -> Iterator[tuple[str, Sequence[Record], Limit, float]]:
    """What is asked of the default: in words, of which pairs, how exact, and of what share."""
    for noise in values(records, "noise"):
        chosen = of(records, noise=noise)
        for protocol, name in product(values(chosen, "protocol"), values(chosen, "object")):
            near = up_to(of(chosen, object=name, protocol=protocol), NEAR_GAP)
            where = f"{name}, {PROTOCOL_TITLES[protocol]}, to {NEAR_GAP}°, {noise_title(noise)}"
            yield where, near, RIGHT, 1.0
        all_of_them = of(chosen, protocol="random")
        for low, _, floor in OVERLAPS:
            if floor is not None:
                where = f"any start, any gap, overlap from {low:.2f}, {noise_title(noise)}"
                yield where, overlapping(all_of_them, low, 1.01), SUCCESS, floor
        far = beyond(all_of_them, NEAR_GAP)
        for low, high, floor in OVERLAPS:
            if floor is not None:
                where = f"any start, beyond {NEAR_GAP}°, overlap {overlap_title(low, high)}"
                inside = overlapping(far, low, high)
                yield f"{where}, {noise_title(noise)}", inside, SUCCESS, floor


def _those_missed(records: Sequence[Record]) -> str:
    if not records:
        return "\nNo pair under these floors misses the error.\n"
    rows = [
        (
            f"{r.unit['object']}, {r.unit['azimuth']}° and {r.unit['azimuth'] + r.unit['gap']}°",
            PROTOCOL_TITLES[r.unit["protocol"]],
            noise_title(r.unit["noise"]),
            f"{r.result['overlap']:.2f}",
            _error(r.result["answers"]["default"]),
            "yes" if r.result["answers"]["default"]["accepted"] else "no",
        )
        for r in records
    ]
    headings = ("pair", "start", "noise", "overlap", "error of the default", "accepted")
    return "\nThe pairs under these floors that miss the error:\n\n" + markdown_table(
        headings, rows
    )


def _error(told: Told) -> str:
    return "no answer" if told["deg"] is None else f"{told['deg']:.1f}°, {told['percent']:.1f} %"


def _plot(records: Sequence[Record], path: Path) -> None:
    """Share of right answers against the gap, a panel for each kind of start."""
    need("matplotlib").use("Agg")
    from matplotlib import pyplot

    protocols = values(records, "protocol")
    figure, panels = pyplot.subplots(
        1, len(protocols), figsize=(11, 4.6), sharey=True, squeeze=False
    )
    lines = {}
    for panel, protocol in zip(panels[0], protocols, strict=True):
        chosen = of(records, protocol=protocol)
        for method in ORDER:
            limit = LIMIT_OF.get(method, RIGHT)
            if told := by_gap(chosen, method):
                shares = [share_right(each, limit) for each in told.values()]
                lines[method] = draw_shares(panel, method, list(told), shares)
        panel.set(title=PROTOCOL_TITLES[protocol], xlabel="gap between the views (°)")
        panel.set_xticks(sorted(values(chosen, "gap")))
        dress(panel)
    panels[0][0].set_ylabel("right answers (%)")
    handles = [lines[method] for method in ORDER if method in lines]
    figure.legend(handles=handles, loc="center right", frameon=False, fontsize=9)
    figure.tight_layout(rect=(0, 0, 0.83, 1))
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
