"""Names as people expect them: 2 before 10, and always in letters that can be written."""

import os
import re


def natural_key(text: str) -> tuple[list[str | int], str]:
    """Sort key by which numbers inside a text compare as numbers; the text itself breaks ties."""
    parts = re.split(r"([0-9]+)", text)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)], text


def printable(text: str) -> str:
    r"""The text with bytes of a file's name that are not UTF-8 spelled out, as ``\xff``."""
    return os.fsencode(text).decode("utf-8", "backslashreplace")
