"""Write the measured parts of README.md and some pages of docs anew, from docs/data.

    python -m benchmarks.pages

``make benchmarks`` measures first, ``python -m benchmarks.fuzz`` and ``benchmarks.reading`` what is
of files. What a part says comes from the JSON alone, so that no figure is typed by hand.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks import (
    blocks,
    depth,
    fuzz,
    model,
    pairs,
    reading,
    run,
    video,
)
from benchmarks.results import DATA, DOCS, ROOT, Json, how_measured, read_results, write_file
from scanweld.io.scan_formats.registry import formats_markdown

PAGES = (
    ROOT / "README.md",
    *(DOCS / f"{name}.md" for name in ("benchmarks", "model", "formats", "depth", "video")),
)
USAGE_ERROR = 2
TABLE_OF_FORMATS = "scan-formats"
"""The one part that is not measured."""
BLOCKS: dict[str, tuple[str, Callable[[Sequence[Json]], Json]]] = {
    **dict.fromkeys(("sets", "sets-in-words"), ("sets", run.over_seeds)),
    **dict.fromkeys(("pairs", "pairs-in-words"), ("pairs", pairs.over_pairs)),
    **dict.fromkeys(("model", "model-rivals", "model-many"), ("model", model.by_kind)),
    "fuzz": ("fuzz", fuzz.by_format),
    "reading": ("reading", reading.over_files),
    "depth": ("depth", depth.by_kind),
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
    if name == TABLE_OF_FORMATS:
        return formats_markdown()
    source, summed_up = BLOCKS[name]
    document = read_results(data / f"{source}.json")
    part = blocks.rendered(name, **summed_up(document["records"]))
    return f"{how_measured(document)}:\n\n{part}"


if __name__ == "__main__":
    sys.exit(main())
