"""What stands above the numbers of a text: comments, column names, the number of points."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from scanweld.errors import ReadError
from scanweld.io.names import printable
from scanweld.io.text import is_any_number

_COMMENT = re.compile(rb"(^|\s)(#|//).*$", re.DOTALL)
"""Not inside a word: some libraries print NaN as 1.#QNAN."""
_BETWEEN = re.compile(rb'[\s,;"]+')
_MARK = re.compile(r"^\s*(#|//|%|!)+")
_UNIT = re.compile(r" *[\[(][^\])]*[\])]")
_HEAD = slice(0, 2**16)
"""Where the numbers must begin, in bytes."""
_MOST_LINES = 5
"""Lines of words above the numbers; a file that has more is of some other format."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Head:
    """What stands above the numbers.

    Attributes:
        lines: All its lines, from the top.
        words: Those of them that are neither empty nor comments.
        count: The number of points that stands alone in one of them, or None.
    """

    lines: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    count: int | None = None

    def names(self) -> Iterator[tuple[str, ...]]:
        """What may be the column names, each in small letters, from the line above the numbers."""
        for line in reversed(self.lines):
            if names := column_names(line):
                yield names


def split_head(path: Path, text: bytes) -> tuple[Head, bytes]:
    """What stands above the numbers, and the text from the first line on that is all numbers.

    Raises:
        ReadError: If there are no numbers, or what is above them looks like numbers too.
    """
    lines = text[_HEAD].splitlines(keepends=True)
    head: list[bytes] = []
    words: list[bytes] = []
    count: int | None = None
    for line, following in zip(lines, [*lines[1:], b""], strict=False):
        filled = without_comment(line).strip()
        cells = _cells(filled)
        if _are_counted_names(cells, following):
            words.append(filled)
        elif cells and all(map(is_any_number, cells)):
            if not (filled.isdigit() and len(filled) < 19 and count is None):
                _check_words(path, words, len(cells))
                break
            count = int(filled)
        elif cells:
            words.append(filled)
        head.append(line)
    else:
        if all(column_names(_decoded(line)) for line in words):
            raise ReadError(f"{path}: holds no points; leave it out")
        return Head(), text  # the parser names the word that is no number
    told = Head(lines=tuple(map(_decoded, head)), words=tuple(map(_decoded, words)), count=count)
    return told, text[sum(map(len, head)) :]


def without_comment(line: bytes) -> bytes:
    """A line up to where a comment begins."""
    return _COMMENT.sub(b"", line)


def column_names(line: str) -> tuple[str, ...]:
    """A line's words as names of columns, in small letters, if x, y and z are among them; or ().

    Units in brackets, quotes and the mark of a comment are left out. The line is cut at its
    semicolons, else at its tabs, else at its commas, else at its spaces.
    """
    line = _UNIT.sub("", _MARK.sub("", line)).strip(" \r\n")
    separator = next((mark for mark in ";\t," if mark in line), None)
    cells = [cell.strip().strip("\"'").strip() for cell in line.split(separator)]
    while cells and not cells[-1]:
        cells.pop()
    names = tuple(re.sub(r"[^a-z0-9]", "", cell.casefold()) for cell in cells)
    return names if {"x", "y", "z"} <= set(map(axis_name, names)) else ()


def axis_name(name: str) -> str:
    """x, y or z where a name means a coordinate; otherwise the name itself."""
    for axis, number in zip("xyz", "012", strict=True):
        usual = (f"{axis}coord", f"{axis}coordinate", f"coord{axis}", f"pos{axis}")
        if name in (axis, *usual, f"position{axis}", f"points{number}"):
            return axis
    return name


def unknown_names(head: Head, width: int) -> str | None:
    """The line above the numbers if it has a word for each column and none is x, y or z."""
    for line in reversed(head.lines):
        words = _cells(_MARK.sub("", line).encode())
        if words:
            return line if len(words) == width and not any(map(is_any_number, words)) else None
    return None


def _are_counted_names(cells: Sequence[bytes], following: bytes) -> bool:
    """Whether a line is 0 1 2 above fractions: what pandas writes above columns without names."""
    counted = [str(k).encode() for k in range(len(cells))]
    return len(cells) > 2 and list(cells) == counted and b"." in following


def _check_words(path: Path, words: Sequence[bytes], width: int) -> None:
    """That lines of words are no points with a slip of the pen, and no other format's head."""
    for line in words:
        cells = _cells(line)
        wrong = [cell for cell in cells if not is_any_number(cell)]
        if len(cells) == width and wrong and 2 * len(wrong) < width:
            raise ReadError(
                f"{path}: {_decoded(wrong[0])!r} in its first line of numbers is not a number; "
                "correct it or export it anew"
            )
    if len(words) > _MOST_LINES:
        raise ReadError(
            f"{path}: {len(words)} lines of words above the numbers ({_decoded(words[0])!r} ...); "
            "give it the suffix of its format, or leave only the column names"
        )


def _cells(line: bytes) -> list[bytes]:
    return [cell for cell in _BETWEEN.split(line) if cell]


def _decoded(line: bytes) -> str:
    return printable(line.decode("utf-8", errors="replace").strip("\r\n")[:200])
