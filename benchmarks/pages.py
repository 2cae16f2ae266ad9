"""Write the measured parts of README.md, docs/benchmarks.md and docs/model.md anew, from docs/data.

    python -m benchmarks.pages

``make benchmarks`` measures first. What a part says comes from the JSON alone, so that no figure is
typed by hand.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import mean

from benchmarks import blocks, keypoints, model, pairs, run
from benchmarks.results import DATA, DOCS, ROOT, Json, how_measured, read_results, write_file

PAGES = (ROOT / "README.md", DOCS / "benchmarks.md", DOCS / "model.md")
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
ANCHORS = {
    "heat": "PA-HKS keypoints alone",
    "even": "evenly spread points",
    "mixed": "both together",
}
MIN_OVERLAP = 0.10
"""Pairs that overlap by as much are told of in the README, beside those of half as much."""
_WIDE, _THIN = f"{100 * MIN_OVERLAP:g} %", f"{50 * MIN_OVERLAP:g} %"

Records = Sequence[Json]


def main() -> int:
    """Write the pages; 2 if a result is missing."""
    try:
        texts = {page: rewritten(page.read_text(encoding="utf-8")) for page in PAGES}
    except FileNotFoundError as error:
        print(f"error: {error.filename}: is missing; run make benchmarks", file=sys.stderr)
        return USAGE_ERROR
    for page, text in texts.items():
        write_file(page, text)
    return 0


def rewritten(text: str, data: Path = DATA) -> str:
    """A page with each of its measured parts as the results have it now.

    Raises:
        FileNotFoundError: If there are no results for one of them.
    """
    return blocks.rewritten(text, lambda name: block(name, data))


def block(name: str, data: Path = DATA) -> str:
    """A measured part of a page, by its name."""
    source, write = BLOCKS[name]
    document = read_results(data / f"{source}.json")
    return f"{how_measured(document)}:\n\n{write(document['records'])}"


def _sets_in_words(runs: Records) -> str:
    headings = (
        *("scans", "right", "wrong", "rotation error mean / max (deg)"),
        *("translation error mean / max (%)", "time", "memory"),
    )
    rows = []
    for name in dict.fromkeys(r["set"] for r in runs):
        of = [r for r in runs if r["set"] == name]
        value = {key: together([r[key] for r in of]) for key, _, together, _ in run.COLUMNS}
        errors = ("rotation", "translation")
        rows.append(
            (
                IN_WORDS[name],
                f"{min(r['right'] for r in of)}/{run.SETS[name].num_scans}",
                max(r["wrong"] for r in of),
                *(f"{value[f'{e}_mean']:.3f} / {value[f'{e}_max']:.3f}" for e in errors),
                # As the other table has it, and then without its digit.
                f"{round(value['seconds'], 1):.0f} s",
                f"{value['peak_mb']:.0f} MB",
            )
        )
    return blocks.markdown_table(headings, rows)


def _pairs_in_words(records: Records) -> str:
    answers = [a for a in _answers(records) if a.anchors == "mixed"]
    wrong = sum(a.kind == "good" and not a.is_right for a in answers)
    wide, thin = _right(answers)
    return (
        f"of the pairs of real scans that overlap by {_WIDE} or more, registered alone from any "
        f"start pose, {wide} have the right answer first, of those between {_THIN} and "
        f"{_WIDE} {thin}; {wrong} wrong pairs of {len(answers)} are called good.\n"
    )


def _pairs(records: Records) -> str:
    """All pairs, and what hypotheses should hang on."""
    answers, told = _answers(records), ""
    for anchors, words in ANCHORS.items():
        of = [a for a in answers if a.anchors == anchors]
        wide, thin = _right(of)
        told += (
            f"- {words}: right first in {wide} pairs that overlap by {_WIDE} or more and in {thin} "
            f"between {_THIN} and {_WIDE}; {mean(a.seconds for a in of):.2f} s a pair\n"
        )
    return f"{pairs.table(answers)}\n{told}"


def _right(answers: Sequence[pairs.Answer]) -> list[str]:
    """Right ones among those that overlap widely, and among those that overlap little."""
    wide = [a for a in answers if a.overlap >= MIN_OVERLAP]
    thin = [a for a in answers if 0.5 * MIN_OVERLAP <= a.overlap < MIN_OVERLAP]
    return [f"{sum(a.is_right for a in some)} of {len(some)}" for some in (wide, thin)]


def _answers(records: Records) -> list[pairs.Answer]:
    return [pairs.Answer(**record) for record in records]


BLOCKS: dict[str, tuple[str, Callable[[Records], str]]] = {
    "sets-in-words": ("sets", _sets_in_words),
    "sets": ("sets", run.table),
    "pairs-in-words": ("pairs", _pairs_in_words),
    "pairs": ("pairs", _pairs),
    "keypoints": ("keypoints", keypoints.table),
    "model": ("model", model.fidelity_table),
    "model-rivals": ("model", model.rivals_table),
    "model-many": ("model", model.many_table),
}
"""Part of a page -> its results in docs/data, and what says them in Markdown."""


if __name__ == "__main__":
    sys.exit(main())
