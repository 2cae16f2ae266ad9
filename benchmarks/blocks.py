"""Measured parts of pages: each stands between <!-- begin: NAME --> and <!-- end -->."""

import re
from collections.abc import Callable

BLOCK = re.compile(r"(<!-- begin: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def rewritten(text: str, block: Callable[[str], str]) -> str:
    """A page with each of its measured parts as ``block`` writes the part of that name."""
    return BLOCK.sub(lambda found: found[1] + block(found[2]) + found[3], text)
