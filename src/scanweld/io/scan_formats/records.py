"""What a format of scans says of itself, and what its reader hands over."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from importlib import import_module
from pathlib import Path
from types import ModuleType

from scanweld.errors import ReadError
from scanweld.io.raw import RawScan


class Keeps(StrEnum):
    """What of a scan, besides its points, a format can hold and its reader keeps."""

    SCANS = "several scans"
    GRID = "grid"
    SENSOR = "sensor"
    POSE = "pose"
    FACES = "faces"
    NORMALS = "normals"
    COLORS = "colours"


@dataclass(frozen=True, kw_only=True, slots=True)
class Part:
    """One of the scans in a file, which is read when it is asked for.

    Attributes:
        name: What the file calls it; empty if it does not.
        read: Reads it; raises ``ReadError``.
    """

    name: str = ""
    read: Callable[[], RawScan]


Reader = Callable[[Path, bytes], RawScan | Sequence[Part]]
"""Reads a file: its path, for messages, and its bytes."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanFormat:
    """A format of files that hold scans. Its module's docstring begins with what it is.

    Attributes:
        suffixes: In lower case, with their points.
        read: Reads the scan, or one ``Part`` for each scan where it keeps ``Keeps.SCANS``. Raises
            ``ReadError``, and nothing else whatever the bytes are.
        keeps: What a scan gets from the file besides its points.
        only_named: Those of the suffixes that are more often no scans: such a file must be named,
            it is left alone in a folder.
        extra: Name of the optional dependencies that the reader needs.
        opens_path: Whether the reader opens the path itself; it is then given no bytes.
        begins: What its files begin with, one of these; empty where that does not tell them.
    """

    suffixes: tuple[str, ...]
    read: Reader
    keeps: tuple[Keeps, ...] = ()
    only_named: tuple[str, ...] = ()
    extra: str = ""
    opens_path: bool = False
    begins: tuple[bytes, ...] = ()


def needed(path: Path, library: str, extra: str) -> ModuleType:
    """A library that is not always there.

    Raises:
        ReadError: If it is missing; the message names the extra that brings it.
    """
    try:
        return import_module(library)
    except ImportError as error:
        raise ReadError(
            f"{path}: reading it needs {library}; install it with pip install 'scanweld[{extra}]'"
        ) from error
