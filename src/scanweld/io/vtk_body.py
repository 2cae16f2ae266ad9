"""The body of a VTK legacy file: lines of keywords, and values behind them."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
from scanweld.errors import ReadError
from scanweld.geometry.arrays import LARGEST_EXACT, BoolArray, IntArray
from scanweld.io.text import parse_numbers

_TYPES = {
    **{"char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2"},
    **{"int": "i4", "unsigned_int": "u4", "long": "i8", "unsigned_long": "u8"},
    **{"float": "f4", "double": "f8", "vtkidtype": "i4", "vtktypeint64": "i8"},
}
_LINE = re.compile(rb"[ \t]*([^\r\n]*)(\r\n|\n|\r|$)")
_COUNT = re.compile(r"\d{1,12}")


@dataclass(slots=True)
class VtkBody:
    """What stands behind the head, read from its begin to its end.

    Attributes:
        path: The file, for messages.
        data: Its bytes.
        at: Offset of what is read next.
        is_binary: Whether values are binary, most significant byte first.
    """

    path: Path
    data: bytes
    at: int
    is_binary: bool

    def line(self) -> list[str]:
        """The words of the next line that is not blank; none at the end."""
        while self.at < len(self.data):
            found = _LINE.match(self.data, self.at)
            if found is None:
                break
            self.at = max(found.end(), self.at + 1)
            if words := found[1].decode("latin-1").split():
                return words
        return []

    def values(self, count: int, kind: str) -> NDArray:
        """So many values of one of VTK's types (N,).

        Raises:
            ReadError: If the type is unknown or the file ends too early.
        """
        code = _TYPES.get(kind.lower())
        if code is None:
            raise ReadError(f"{self.path}: unknown type {kind!r} of values; save the file anew")
        if self.is_binary:
            size = count * int(code[1:])
            if self.at + size > len(self.data):
                raise self.too_short()
            begin, self.at = self.at, self.at + size
            return np.frombuffer(self.data, ">" + code, count, begin)
        if 2 * count > len(self.data) - self.at + 1:
            raise self.too_short()
        end = _after_words(self.data, self.at, count)
        line = 1 + self.data.count(b"\n", 0, self.at)
        text, self.at = self.data[self.at : end], end
        numbers = parse_numbers(self.path, text, line)
        if len(numbers) != count:
            raise self.too_short()
        return numbers

    def rest_of_line(self) -> bytes:
        """The next line, blank or not."""
        found = _LINE.match(self.data, self.at)
        if found is None:
            return b""
        self.at = max(found.end(), min(self.at + 1, len(self.data)))
        return found[1]

    def number(self, word: str) -> int:
        """A word as a count.

        Raises:
            ReadError: If it is none.
        """
        if not _COUNT.fullmatch(word):
            raise ReadError(f"{self.path}: {word[:40]!r} is no number; save the file anew")
        return int(word)

    def cells(self, count: int, size: int) -> tuple[IntArray, IntArray]:
        """How many corners each of the next cells has, and the corners, cell after cell.

        Args:
            count: Cells; or, from version 5 on, offsets, of which there is one more.
            size: Numbers in the list; or, from version 5 on, corners.

        Raises:
            ReadError: If they are broken.
        """
        begin = self.at
        words = self.line()
        if words[:1] == ["OFFSETS"] and len(words) == 2:
            ends = self._integers(count, words[1])
            words = self.line()
            if words[:1] != ["CONNECTIVITY"] or len(words) != 2:
                raise self.broken("OFFSETS without CONNECTIVITY")
            corners = self._integers(size, words[1])
            if not count or ends[0] != 0 or ends[-1] != size or (np.diff(ends) < 0).any():
                raise self.broken("the OFFSETS of its cells are wrong")
            return np.diff(ends), corners
        self.at = begin
        values = self._integers(size, "int")
        counts, is_corner = np.zeros(min(count, size), np.int64), np.ones(size, np.bool_)
        if len(counts) != count or not _split_cells(values, counts, is_corner):
            raise self.broken("its cells do not fill their list")
        return counts, values[is_corner]

    def _integers(self, count: int, kind: str) -> IntArray:
        """The same for whole numbers."""
        values = self.values(count, kind)
        if values.dtype.kind == "f" and not (np.abs(values) < LARGEST_EXACT).all():
            raise self.broken("its cells are not made of whole numbers")
        return values.astype(np.int64)

    def broken(self, what: str) -> ReadError:
        """What is said of a broken file."""
        return ReadError(f"{self.path}: {what}; save the file anew")

    def too_short(self) -> ReadError:
        """What is said of a file that is cut off."""
        return self.broken("ends too early (truncated, or a wrong count)")


def _after_words(data: bytes, at: int, count: int) -> int:
    """Where the text goes on after so many words, or its end."""
    if not count:
        return at
    rest = np.frombuffer(data, np.uint8)[at:]
    is_space = (rest == 32) | ((rest >= 9) & (rest <= 13))
    ends = np.flatnonzero(~is_space & np.append(is_space[1:], True))
    return at + int(ends[count - 1]) + 1 if len(ends) >= count else len(data)


@njit(cache=True, nogil=True)
def _split_cells(
    values: IntArray, counts: IntArray, is_corner: BoolArray
) -> bool:  # pragma: no cover - compiled
    """Find the lengths that stand before each cell's corners; whether they fill the list."""
    at = 0
    for k in range(len(counts)):
        if at >= len(values) or values[at] < 0 or values[at] >= len(values) - at:
            return False
        counts[k] = values[at]
        is_corner[at] = False
        at += 1 + values[at]
    return at == len(values)
