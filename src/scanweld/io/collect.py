"""From what a user names to the files that are scans, each with a unique name."""

import glob
import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

from scanweld.errors import InputError, ReadError
from scanweld.geometry.scan import RangeScan
from scanweld.io.names import natural_key, printable
from scanweld.io.not_scans import foreign_kind, inventory, why_unread
from scanweld.io.read import READERS, read_scan

logger = logging.getLogger(__name__)

_ONLY_WHEN_NAMED = frozenset({".txt", ".csv"})
"""Found in a folder these are more often a README or a table than a scan: they must be named."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanFile:
    """A file to be read as a scan, and the scan's name, unique in the run."""

    path: Path
    name: str

    def read(self) -> RangeScan:
        """Read the scan.

        Raises:
            ReadError: If it cannot be read.
        """
        return read_scan(self.path, self.name)


def collect(inputs: Sequence[Path | str]) -> tuple[ScanFile, ...]:
    """The scans that folders, glob patterns and files name, in natural order of their paths.

    Of a folder (not those inside it) and of a pattern, hidden files and files of unknown formats
    are left out; ``.txt`` and ``.csv`` count only when named, or by a pattern that ends so. The
    files themselves are not opened. A file that is named twice counts once.

    Names are the files' stems; if two share one, all names become paths relative to the common
    parent, without suffix unless that is needed to tell them apart.

    Raises:
        ReadError: If a named file is missing or of an unknown format.
        InputError: If a folder or a pattern holds no scans, or nothing is named.
    """
    if not inputs:
        raise InputError("no scans given; name a folder or files")
    found = {Path(os.path.abspath(path)): path for each in inputs for path in _expand(each)}
    absolute = sorted(found, key=lambda path: natural_key(path.as_posix()))
    return tuple(
        ScanFile(path=found[path], name=printable(name))
        for path, name in zip(absolute, _unique_names(absolute), strict=True)
    )


def _expand(each: Path | str) -> list[Path]:
    path = Path(each)
    if path.is_dir():
        try:
            return _scans_among(sorted(path.iterdir()), f"{path}: the folder", _ONLY_WHEN_NAMED)
        except OSError as error:
            raise ReadError(f"{path}: cannot be listed ({error.strerror}); check it") from error
    if not path.exists() and glob.has_magic(str(each)):
        matches = [Path(match) for match in sorted(glob.glob(str(each)))]
        return _scans_among(
            matches, f"{each}: the pattern", _ONLY_WHEN_NAMED - {path.suffix.lower()}
        )
    if not path.exists():
        raise ReadError(f"{path}: there is no such file; check the path")
    if path.suffix.lower() not in READERS:
        raise ReadError(why_unread(path, READERS))
    return [path]


def _scans_among(candidates: list[Path], where: str, left_out: frozenset[str]) -> list[Path]:
    known = READERS.keys() - left_out
    scans: list[Path] = []
    others: list[Path] = []
    for path in candidates:
        is_scan = path.suffix.lower() in known and not path.name.startswith(".")
        is_dangling = path.is_symlink() and not path.exists()
        if is_scan and (path.is_file() or is_dangling):  # the reader says what is wrong with it
            scans.append(path)
        else:
            others.append(path)
    found = inventory(others, left_out)
    if not scans:
        formats = ", ".join(suffix for suffix in READERS if suffix in known)
        told = f", but {found}" if found else ""
        raise InputError(f"{where} holds no scans{told}; scanweld looks for {formats} there")
    if found:
        is_meant = any(foreign_kind(path) is not None for path in others)
        logger.log(logging.WARNING if is_meant else logging.INFO, "%s also holds %s", where, found)
    return scans


def _unique_names(paths: list[Path]) -> list[str]:
    stems = [path.stem for path in paths]
    if len(set(stems)) == len(stems):
        return stems
    parent = os.path.commonpath([path.parent for path in paths])
    relative = [PurePath(os.path.relpath(path, parent)) for path in paths]
    short = [path.with_suffix("").as_posix() for path in relative]
    return short if len(set(short)) == len(short) else [path.as_posix() for path in relative]
