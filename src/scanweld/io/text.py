"""Numbers in text, parsed in bulk, with the line of the first that is none."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray

_BLOCK = 2**22
_NOT_A_NUMBER = re.compile(rb"[+-]?(nan(\(\w*\))?|1\.?#(qnan|snan|ind)\d*)", re.IGNORECASE)
"""How some C libraries print what is not a number: nan(ind), -1.#IND00."""


def parse_numbers(path: Path, text: bytes, first_line: int = 1) -> FloatArray:
    """All numbers of a text, separated by white space; ``nan`` and ``inf`` are numbers too.

    Args:
        path: The file, for messages.
        text: The text.
        first_line: Number of its first line in the file, for messages.

    Raises:
        ReadError: If something in the text is no number.
    """
    try:
        return np.fromiter(map(float, _words(text)), dtype=np.float64)
    except ValueError:  # rare: look word by word, to accept odd spellings and to name the line
        words = (
            (word, number)
            for number, line in enumerate(text.splitlines(), start=first_line)
            for word in line.split()
        )
        return np.array([_number(path, word, number) for word, number in words], dtype=np.float64)


def _words(text: bytes) -> Iterator[bytes]:
    """All words of a text; a few megabytes at a time, as each takes many times its letters."""
    start = 0
    while start < len(text):
        end = text.find(b"\n", start + _BLOCK)
        end = len(text) if end < 0 else end
        yield from text[start:end].split()
        start = end


def is_number(word: bytes) -> bool:
    """Whether a word can be read as a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def _number(path: Path, word: bytes, line_number: int) -> float:
    try:
        return float(word)
    except ValueError:
        if _NOT_A_NUMBER.fullmatch(word):
            return float("nan")
        shown = word[:40].decode("ascii", errors="replace")
        raise ReadError(
            f"{path}: line {line_number}: {shown!r} is not a number; correct it or export it anew"
        ) from None
