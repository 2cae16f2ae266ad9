"""Numbers in text, parsed in bulk, with the line of the first that is none."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scanweld.compiled.kernels import njit
from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray

_BLOCK = 2**22
_NOT_A_NUMBER = re.compile(
    rb"[+-]?(nan(\(\w*\))?|1\.?#(qnan|snan|ind|inf)\d*)|#?n/?a|null|none", re.IGNORECASE
)
"""How C libraries print what is not finite (nan(ind), -1.#IND00), and tables what is not there."""
_FORTRAN = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)[dD][+-]?\d+")
"""Double precision as Fortran prints it: 1.5D+02."""
_EXPONENT = bytes.maketrans(b"dD", b"ee")
_MAX_DIGITS = np.finfo(np.float64).precision
"""A number of so many digits is exact in double precision,"""
_POWERS = 10.0 ** np.arange(23)
"""and so are these powers of ten: multiplied or divided by one it is rounded once, as it should."""


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
        return np.concatenate([np.zeros(0), *map(_numbers, _blocks(text))])
    except ValueError:  # rare: look word by word, to accept odd spellings and to name the line
        words = (
            (word, number)
            for number, line in enumerate(text.splitlines(), start=first_line)
            for word in line.split()
        )
        return np.array([_number(path, word, number) for word, number in words], dtype=np.float64)


def _blocks(text: bytes) -> Iterator[bytes]:
    """A text in blocks of whole lines, as its words take many times its letters."""
    start = 0
    while start < len(text):
        end = text.find(b"\n", start + _BLOCK)
        end = len(text) if end < 0 else end
        yield text[start:end]
        start = end


def _numbers(text: bytes) -> FloatArray:
    """All numbers of a text, the simple ones by compiled code, the rest by ``float``."""
    values, begins = _simple_numbers(np.frombuffer(text, np.uint8))
    left = np.flatnonzero(np.isnan(values))
    if 2 * len(left) > len(values):
        return np.fromiter(map(plain_number, text.split()), dtype=np.float64)
    ends = np.append(begins[1:], len(text))[left]
    values[left] = [
        plain_number(text[begin:end])
        for begin, end in zip(begins[left].tolist(), ends.tolist(), strict=True)
    ]
    return values


@njit(cache=True, nogil=True)
def _simple_numbers(
    text: ByteArray,
) -> tuple[FloatArray, IntArray]:  # pragma: no cover - compiled
    """The words' values (N,), NaN where a word is no simple decimal number, and their begins."""
    count, was_space = 0, True
    for letter in text:
        is_space = letter == 32 or 9 <= letter <= 13
        count += was_space and not is_space
        was_space = is_space
    values, begins = np.empty(count), np.empty(count, dtype=np.int64)
    at, length = 0, len(text)
    for k in range(count):
        while text[at] == 32 or 9 <= text[at] <= 13:
            at += 1
        begins[k] = at
        is_negative = text[at] == 45
        at += is_negative or text[at] == 43
        mantissa, digits, exponent, has_digits, after_point = 0, 0, 0, False, False
        while at < length and (48 <= text[at] <= 57 or (text[at] == 46 and not after_point)):
            if text[at] == 46:
                after_point = True
            else:
                has_digits = True
                exponent -= after_point
                digits += digits > 0 or text[at] != 48
                if digits <= _MAX_DIGITS:
                    mantissa = 10 * mantissa + (text[at] - 48)
            at += 1
        is_simple = has_digits and digits <= _MAX_DIGITS
        if has_digits and at + 1 < length and (text[at] == 69 or text[at] == 101):
            at += 1
            sign = -1 if text[at] == 45 else 1
            at += text[at] == 45 or text[at] == 43
            begin, power = at, 0
            while at < length and 48 <= text[at] <= 57:
                power = min(10 * power + (text[at] - 48), 100_000)
                at += 1
            is_simple &= at > begin
            exponent += sign * power
        if at < length and not (text[at] == 32 or 9 <= text[at] <= 13):
            is_simple = False
            while at < length and not (text[at] == 32 or 9 <= text[at] <= 13):
                at += 1
        value = np.nan
        if is_simple and abs(exponent) < len(_POWERS):
            power_of_ten = _POWERS[abs(exponent)]
            value = mantissa * power_of_ten if exponent > 0 else mantissa / power_of_ten
            value = -value if is_negative else value
        values[k] = value
    return values, begins


def words_per_line(text: bytes) -> IntArray:
    """How many words each line (N,) of a text has."""
    return _words_per_line(np.frombuffer(text, np.uint8))


@njit(cache=True, nogil=True)
def _words_per_line(text: ByteArray) -> IntArray:  # pragma: no cover - compiled
    num_lines = 1
    for at in range(len(text)):
        num_lines += text[at] == 10 or (text[at] == 13 and text[min(at + 1, len(text) - 1)] != 10)
    counts = np.zeros(num_lines, dtype=np.int64)
    line, was_space = 0, True
    for at in range(len(text)):
        is_space = text[at] == 32 or 9 <= text[at] <= 13
        counts[line] += was_space and not is_space
        was_space = is_space
        line += text[at] == 10 or (text[at] == 13 and text[min(at + 1, len(text) - 1)] != 10)
    return counts


def is_number(word: bytes) -> bool:
    """Whether a word can be read as a number, by ``float`` and by ``parse_numbers``."""
    try:
        plain_number(word)
    except ValueError:
        return False
    return True


def is_any_number(word: bytes) -> bool:
    """Whether a word can be read as a number by ``parse_numbers``, in whatever spelling."""
    return is_number(word) or bool(_NOT_A_NUMBER.fullmatch(word) or _FORTRAN.fullmatch(word))


def plain_number(word: bytes) -> float:
    """A word as a number.

    Raises:
        ValueError: If it is none.
    """
    if b"_" in word:  # groups of digits to Python, and to nobody who writes scans
        raise ValueError("underscore")
    return float(word)


def _number(path: Path, word: bytes, line_number: int) -> float:
    if is_number(word):
        return float(word)
    if _FORTRAN.fullmatch(word):
        return float(word.translate(_EXPONENT))
    if _NOT_A_NUMBER.fullmatch(word):
        return float("nan")
    shown = word[:40].decode("utf-8", errors="replace")
    raise ReadError(
        f"{path}: line {line_number}: {shown!r} is not a number; correct it or export it anew"
    )
