"""What stands above the numbers of a text: comments, column names, the number of points."""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from scanweld.errors import ReadError
from scanweld.io.names import printable
from scanweld.io.text import is_any_number
from scanweld.io.text_encoding import HEAD

_COMMENT = re.compile(rb"(^|\s)(#(?!N/A)|//).*$", re.DOTALL)
"""Not inside a word: some libraries print NaN as 1.#QNAN, and tables as #N/A."""
_BETWEEN = re.compile(rb'[\s,;"]+')
_MARK = re.compile(r"^\s*(#|//|%|!)+")
_LETTER, _DIGIT = re.compile(rb"[A-Za-z]"), re.compile(rb"\d")
_UNIT = re.compile(r" *[\[(][^\])]*[\])]")
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
    lines = text[HEAD].splitlines(keepends=True)
    head: list[bytes] = []
    words: list[bytes] = []
    names: tuple[str, ...] = ()
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
        elif _is_row(_decoded(filled), names):
            _check_words(path, words)
            break
        elif cells:
            words.append(filled)
        names = column_names(_decoded(line)) or names
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
    cells = row_cells(_UNIT.sub("", _MARK.sub("", line)))
    while cells and not cells[-1]:
        cells.pop()
    names = tuple(re.sub(r"[\W_]", "", cell.casefold()) for cell in cells)
    return names if {"x", "y", "z"} <= set(map(axis_name, names)) else ()


def row_cells(line: str) -> list[str]:
    """A line cut at its semicolons, else tabs, else commas, else spaces, but not inside quotes."""
    line = line.strip(" \r\n")
    mark = next((mark for mark in ";\t," if mark in line), None)
    if mark is None:
        return [cell.strip("\"'") for cell in line.split()]
    try:
        cells = next(csv.reader([line], delimiter=mark, skipinitialspace=True), [])
    except csv.Error:  # a line of 100 kB, for example
        cells = line.split(mark)
    return [cell.strip().strip("\"'").strip() for cell in cells]


def axis_name(name: str) -> str:
    """x, y or z where a name means a coordinate; otherwise the name itself."""
    for axis, number in zip("xyz", "012", strict=True):
        usual = (f"{axis}coord", f"{axis}coordinate", f"coord{axis}", f"pos{axis}", f"{axis}pos")
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


def _is_row(line: str, names: Sequence[str]) -> bool:
    """Whether a line has a cell for each name, with numbers where a point's coordinates are."""
    cells = row_cells(line)
    axes = [k for k, name in enumerate(names) if axis_name(name) in tuple("xyz")]
    words = [cells[k].replace(",", ".").encode() for k in axes if len(cells) == len(names)]
    return bool(words) and all(map(is_any_number, words))


def _check_words(path: Path, words: Sequence[bytes], width: int = 0) -> None:
    """That lines of words are no points with a slip of the pen, and no other format's head."""
    if words and words[0].lower().startswith(b"ncols"):
        raise ReadError(f"{path}: is a raster of heights (ESRI ASCII grid); export it as points")
    for line in words:
        cells = _cells(line)
        wrong = [cell for cell in cells if not is_any_number(cell)]
        are_numbers = 2 * len(wrong) < width or not _LETTER.search(line)
        if len(cells) == width and wrong and are_numbers and _DIGIT.search(line):
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
