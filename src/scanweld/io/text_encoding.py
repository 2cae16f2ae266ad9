"""Text of any encoding as plain bytes: byte order marks, UTF-16 and UTF-32."""

import codecs
from pathlib import Path

from scanweld.errors import ReadError

UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""That of UTF-32 begins with that of UTF-16, so it is tried first."""
BEGIN = slice(0, 400)
"""Of a file: bytes that tell what it is, and where a text would show its zero bytes."""
HEAD = slice(0, 2**16)
"""Of a text, in bytes: its numbers must begin there, and what separates them shows there."""


def plain_text(path: Path, data: bytes) -> bytes:
    """A text whose numbers and separators are single bytes, without byte order mark.

    Raises:
        ReadError: If it is no text, or not of the encoding that it begins with.
    """
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), None)
    if encoding == "utf-8":
        data, encoding = data.removeprefix(codecs.BOM_UTF8), None
    elif encoding is None and b"\0" in data[BEGIN]:
        encoding = _without_mark(path, data[BEGIN])
    if encoding is not None:
        try:
            data = data.decode(encoding).encode()
        except UnicodeError as error:
            raise ReadError(
                f"{path}: begins as {encoding.upper()} but is not ({error}); copy it again or save "
                "it as UTF-8"
            ) from error
    return data.removesuffix(b"\x1a")  # how DOS ends a text


def _without_mark(path: Path, begin: bytes) -> str:
    """The encoding of a text with zero bytes: those of letters that need one byte only."""
    for size in (2, 4):
        is_zero = [not any(begin[k::size]) for k in range(size)]
        for order, k in (("le", 0), ("be", size - 1)):
            if all(begin[k::size]) and sum(is_zero) == size - 1:
                return f"utf-{8 * size}-{order}"
    raise ReadError(
        f"{path}: is binary, not text; give it the suffix of its format or export it as text"
    )
