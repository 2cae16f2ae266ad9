"""Markdown tables, and measured parts of pages between <!-- begin: NAME --> and <!-- end -->."""

import re
from collections.abc import Callable, Iterable, Sequence

BLOCK = re.compile(r"(<!-- begin: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def rewritten(text: str, block: Callable[[str], str]) -> str:
    """A page with each of its measured parts as ``block`` writes the part of that name."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{block(found[2])}\n{found[3]}", text)


def markdown_table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown, its last line ended."""
    lines = [f"| {' | '.join(map(str, cells))} |\n" for cells in (headings, *rows)]
    return "".join([lines[0], "|" + "---|" * len(headings) + "\n", *lines[1:]])


def judged(text: str, is_met: bool) -> str:
    """A cell, marked where a floor is missed."""
    return text if is_met else f"**{text} FAIL**"
