"""Names as people expect them: 2 before 10, and always in letters that can be written."""

import os
import re
from pathlib import Path, PurePath


def natural_key(text: str) -> tuple[list[str | int], str]:
    """Sort key by which numbers inside a text compare as numbers; the text itself breaks ties."""
    parts = re.split(r"([0-9]+)", text)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)], text


def printable(text: str) -> str:
    r"""The text with bytes of a file's name that are not UTF-8 spelled out, as ``\xff``."""
    return os.fsencode(text).decode("utf-8", "backslashreplace")


def path_from(folder: Path, path: Path) -> str:
    """The path as seen from a folder, with slashes; the whole path where it is on another drive."""
    whole = os.path.abspath(path)
    try:
        return Path(os.path.relpath(whole, folder)).as_posix()
    except ValueError:  # Windows, another drive
        return Path(whole).as_posix()


def suffix_of(path: PurePath) -> str:
    """The suffix that tells a file's format, in lower case: that before a ``.gz``."""
    return (PurePath(path.stem) if is_gzipped(path) else path).suffix.lower()


def stem_of(path: PurePath) -> str:
    """The file's name without that suffix, and without ``.gz``."""
    return PurePath(path.stem).stem if is_gzipped(path) else path.stem


def is_gzipped(path: PurePath) -> bool:
    """Whether a file is packed as a whole, by its name."""
    return path.suffix.lower() == ".gz"
