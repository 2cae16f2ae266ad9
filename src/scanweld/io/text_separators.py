"""What separates the numbers of a text, and what its commas mean: read right, or refused."""

import re
from collections.abc import Collection
from pathlib import Path

from scanweld.errors import ReadError
from scanweld.io.text_encoding import HEAD

_BETWEEN_WORDS = re.compile(rb"[ \t](?<=[^\s,;][ \t])[ \t]*[^\s,;]")
_INSIDE_WORD = re.compile(rb",(?<=\d,)[-+.\d]")
_NO_DECIMAL = re.compile(rb",((?!\d)|(?<!\d,)|\d+,)")
"""Commas that cannot be decimal ones: at the end of a word, or two in it."""
_DECIMAL = re.compile(rb",((?<=[^\d]0,)|(?<=^0,)|(?<=\d{4},)|\d{1,2}(?!\d)|\d{4})")
"""Commas that cannot separate thousands: 0,123 or 1234,5 or 1,25 or 1,2345."""
_FRACTION = re.compile(rb",0\d")
"""No whole number begins so: it goes on from before the comma."""
_SPACED = re.compile(rb",[ \t]")
_TIGHT = re.compile(rb",[^\s,]")
_GROUPED = re.compile(rb"(?<![\d.,])[1-9]\d{0,2}(?: \d{3})+(?!\d)")
"""What may be one number whose thousands are set apart, or several."""
_ZERO_GROUP = re.compile(rb"(?<![\d.,])[1-9]\d{0,2} 0\d\d(?!\d)")
"""What can hardly be several: no number begins so."""
_BETWEEN_DIGITS = re.compile(rb"\d +(?=[-+.\d])")
_LINE = re.compile(rb"[^\r\n]*[^\s][^\r\n]*")
_EMPTY_CELL = rb"((?<=%b)|(?<![^\r\n]))[ \t]*(?=%b)"
_MOST_CERTAIN = 4
"""Whole numbers between commas in a line: with one more, two and more may be fractions."""
_POINTS = bytes.maketrans(b",;", b". ")
_SPACES = bytes.maketrans(b",;", b"  ")


def with_spaces(
    path: Path, text: bytes, named: Collection[int] = (), first_line: int = 1
) -> tuple[bytes, bool]:
    """A text whose numbers are separated by white space and have decimal points.

    Args:
        path: The file, for messages.
        text: Lines of numbers.
        named: How many columns the line of names above may speak of.
        first_line: Number of the text's first line in the file, for messages.

    Returns:
        The text, and whether its commas were decimal ones.

    Raises:
        ReadError: If it cannot be told for certain what its commas mean.
    """
    if b'"' in text:
        text = _without_quotes(text)
    if _has_spaced_thousands(text[HEAD]):
        raise _refused(path, text, "a space in its numbers may separate thousands", first_line)
    if b"," not in text:
        return (_filled(text, b";").translate(_SPACES) if b";" in text else text), False
    if b";" in text or (_INSIDE_WORD.search(text) and _has_spaced_words(text)):
        if reason := _why_not_decimal(text):
            raise _refused(path, text, reason, first_line)
        return _filled(text, b";").translate(_POINTS), True
    if reason := _why_not_separators(text, named):
        raise _refused(path, text, reason, first_line)
    return _filled(text, b",").translate(_SPACES), False


def _without_quotes(text: bytes) -> bytes:
    """The text without quotes; a comma in quotes belongs to a number, the others become ``;``."""
    parts = text.split(b'"')
    if any(b"," in quoted for quoted in parts[1::2]):
        parts[::2] = [between.replace(b",", b";") for between in parts[::2]]
    return b"".join(parts)


def _has_spaced_words(text: bytes) -> bool:
    return (b" " in text or b"\t" in text) and bool(_BETWEEN_WORDS.search(text))


def _has_spaced_thousands(text: bytes) -> bool:
    """Whether spaces may stand inside numbers: in all places if something else is between them."""
    grouped = sum(found[0].count(b" ") for found in _GROUPED.finditer(text))
    if grouped and (b";" in text or b"\t" in text):
        return grouped == sum(1 for _ in _BETWEEN_DIGITS.finditer(text))
    return grouped > 0 and bool(_ZERO_GROUP.search(text))


def _why_not_decimal(text: bytes) -> str:
    if b"." in text:
        return "commas and points in its numbers: one separates thousands, or notations are mixed"
    if _NO_DECIMAL.search(text):
        return "commas as well as semicolons or spaces between its numbers"
    if not _DECIMAL.search(text):
        return "each comma has three digits behind it and may separate thousands or decimals"
    return ""


def _why_not_separators(text: bytes, named: Collection[int]) -> str:
    unclear = "its commas may be decimal ones as well as separators"
    if _FRACTION.search(text):
        return unclear
    if b"." in text:
        return ""
    if _SPACED.search(text):
        return unclear if _TIGHT.search(text) else ""
    first = _LINE.search(text)
    width = 0 if first is None else len(first[0].strip(b", \t").split(b","))
    return unclear if width > _MOST_CERTAIN and width not in named else ""


def _refused(path: Path, text: bytes, reason: str, first_line: int) -> ReadError:
    """The reason, with the first line that has a comma, or a space."""
    mark = b"," if b"," in text else b" "
    at = next((line for line in _LINE.finditer(text) if mark in line[0]), None)
    shown = "" if at is None else at[0].strip()[:40].decode("ascii", errors="replace")
    number = first_line if at is None else first_line + len(text[: at.start()].splitlines())
    return ReadError(
        f"{path}: line {number}: {shown!r}: {reason}; write decimals with a point and separate "
        "the numbers by spaces"
    )


def _filled(text: bytes, mark: bytes) -> bytes:
    """The text with ``nan`` in empty cells, so that the columns behind them keep their places."""
    if text.startswith(mark) or re.search(rb"%b(?<=[\s%b]%b)" % (mark, mark, mark), text):
        return re.sub(_EMPTY_CELL % (mark, mark), b"nan", text)
    return text
