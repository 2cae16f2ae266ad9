"""Write the measured parts of the README and of docs/benchmarks.md anew, from docs/data.

    python benchmarks/pages.py

``make benchmarks`` measures first. What a part says comes from the JSON alone, so that no figure is
typed by hand.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import mean
from typing import Any

import blocks
import keypoints
import model_tables
import pairs
import run
from results import DATA, read_results
from scanweld.io.atomic import write_whole

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", ROOT / "docs/benchmarks.md", ROOT / "docs/model.md")
USAGE_ERROR = 2
IN_WORDS = {
    "bunny10": "Stanford bunny, 10 real scans",
    "bunny4": "its 4 side views, 90 deg apart",
    "dragon15": "Stanford dragon, 15 real scans",
    "dragon5": "5 of them, 72 deg apart",
    "dragon8": "8 of them, 48 deg apart",
    "demo": "the demo: 10 simulated scans",
    "bunny10-rotated": "bunny, files in any rotation",
}
MIN_OVERLAP = 0.10
"""Pairs that overlap by as much are told of in the README, beside those of half as much."""
_WIDE, _THIN = f"{100 * MIN_OVERLAP:g} %", f"{50 * MIN_OVERLAP:g} %"

Records = Sequence[dict[str, Any]]


def main() -> int:
    """Write the pages; 2 if a result is missing."""
    try:
        texts = {page: rewritten(page.read_text(encoding="utf-8")) for page in PAGES}
    except FileNotFoundError as error:
        print(f"error: {error.filename}: is missing; run make benchmarks", file=sys.stderr)
        return USAGE_ERROR
    for page, text in texts.items():
        write_whole(page, text.encode())
    return 0


def rewritten(text: str) -> str:
    """A page with each of its measured parts as the results have it now.

    Raises:
        FileNotFoundError: If there are no results for one of them.
    """
    return blocks.rewritten(text, block)


def block(name: str) -> str:
    """A measured part of a page, by its name."""
    source, write = BLOCKS[name]
    document = read_results(DATA / f"{source}.json")
    told = f"`{document['command']}`, on {document['machine']}:\n\n"
    return f"\n{told}{write(document['records'])}\n"


def _sets_in_words(runs: Records) -> str:
    headings = (
        *("scans", "right", "wrong", "rotation error mean / max (deg)"),
        *("translation error mean / max (%)", "time", "memory"),
    )
    lines = [f"| {' | '.join(headings)} |", "|" + "---|" * len(headings)]
    for name in dict.fromkeys(r["set"] for r in runs):
        of = [r for r in runs if r["set"] == name]
        value = {
            key: f"{together([r[key] for r in of]):.{digits}f}"
            for key, _, together, digits in run.COLUMNS
        }
        cells = (
            IN_WORDS[name],
            f"{min(r['right'] for r in of)}/{run.SETS[name].floors.right}",
            str(max(r["wrong"] for r in of)),
            f"{value['rotation_mean']} / {value['rotation_max']}",
            f"{value['translation_mean']} / {value['translation_max']}",
            f"{float(value['seconds']):.0f} s",
            f"{value['peak_mb']} MB",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _sets(runs: Records) -> str:
    return "\n".join(run.table(list(runs))[0]) + "\n"


def _pairs_in_words(records: Records) -> str:
    answers = [a for a in _answers(records) if a.anchors == "mixed"]
    wide = [a for a in answers if a.overlap >= MIN_OVERLAP]
    thin = [a for a in answers if 0.5 * MIN_OVERLAP <= a.overlap < MIN_OVERLAP]
    wrong = sum(a.kind == "good" and not a.is_right for a in answers)
    return (
        f"of the pairs of real scans that overlap by {_WIDE} or more, registered alone from any "
        f"start pose, {_right(wide)} have the right answer first, of those between {_THIN} and "
        f"{_WIDE} {_right(thin)}; {wrong} wrong pairs of {len(answers)} are called good.\n"
    )


def _pairs(records: Records) -> str:
    return "\n".join(pairs.table(_answers(records))[0]) + "\n\n" + _anchors_compared(records)


def _anchors_compared(records: Records) -> str:
    """What hypotheses should hang on, and why."""
    told = []
    for anchors, words in (
        ("heat", "PA-HKS keypoints alone"),
        ("even", "evenly spread points"),
        ("mixed", "both together"),
    ):
        of = [a for a in _answers(records) if a.anchors == anchors]
        wide = [a for a in of if a.overlap >= MIN_OVERLAP]
        thin = [a for a in of if 0.5 * MIN_OVERLAP <= a.overlap < MIN_OVERLAP]
        told.append(
            f"- {words}: right first in {_right(wide)} pairs that overlap by {_WIDE} or more and "
            f"in {_right(thin)} between {_THIN} and {_WIDE}; {mean(a.seconds for a in of):.2f} s "
            "a pair\n"
        )
    return "".join(told)


def _right(answers: Sequence[pairs.Answer]) -> str:
    return f"{sum(a.is_right for a in answers)} of {len(answers)}"


def _answers(records: Records) -> list[pairs.Answer]:
    return [pairs.Answer(**record) for record in records]


def _keypoints(records: Records) -> str:
    return "\n".join(keypoints.table(records)) + "\n"


def _model(records: Records) -> str:
    return "\n".join(model_tables.fidelity_table(records)) + "\n"


def _model_rivals(records: Records) -> str:
    return "\n".join(model_tables.rivals_table(records)) + "\n"


def _model_many(records: Records) -> str:
    return "\n".join(model_tables.many_table(records)) + "\n"


BLOCKS: dict[str, tuple[str, Callable[[Records], str]]] = {
    "sets-in-words": ("sets", _sets_in_words),
    "sets": ("sets", _sets),
    "pairs-in-words": ("pairs", _pairs_in_words),
    "pairs": ("pairs", _pairs),
    "keypoints": ("keypoints", _keypoints),
    "model": ("model", _model),
    "model-rivals": ("model", _model_rivals),
    "model-many": ("model", _model_many),
}
"""Part of a page -> its results in docs/data, and what says them in Markdown."""


if __name__ == "__main__":
    sys.exit(main())
