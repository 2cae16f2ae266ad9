"""Write the measured parts of README.md and of pages in docs anew, from docs/data.

    python -m benchmarks.pages

``make benchmarks`` measures first. What a part says comes from the JSON alone, so that no figure is
typed by hand.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks import blocks, keypoints, model, pairs, run, video
from benchmarks.results import DATA, DOCS, ROOT, Json, how_measured, read_results, write_file

PAGES = (ROOT / "README.md", DOCS / "benchmarks.md", DOCS / "model.md", DOCS / "video.md")
USAGE_ERROR = 2
BLOCKS: dict[str, tuple[str, Callable[[Sequence[Json]], Json]]] = {
    **dict.fromkeys(("sets", "sets-in-words"), ("sets", run.over_seeds)),
    **dict.fromkeys(("pairs", "pairs-in-words"), ("pairs", pairs.over_pairs)),
    "keypoints": ("keypoints", keypoints.over_views),
    **dict.fromkeys(("model", "model-rivals", "model-many"), ("model", model.by_kind)),
    "video": ("video", video.by_part),
}
"""Part of a page, and its template -> its results in docs/data, and what sums these up for it."""


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
    source, summed_up = BLOCKS[name]
    document = read_results(data / f"{source}.json")
    part = blocks.rendered(name, **summed_up(document["records"]))
    return f"{how_measured(document)}:\n\n{part}"


if __name__ == "__main__":
    sys.exit(main())
