"""From what a user names to the files that are scans, each with a unique name."""

import glob
import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

from scanweld.errors import InputError, ReadError
from scanweld.geometry.scan import RangeScan
from scanweld.io.names import natural_key, printable, stem_of, suffix_of
from scanweld.io.not_scans import foreign_kind, inventory, why_unread
from scanweld.io.read import part_names, read_scan
from scanweld.io.scan_formats.registry import format_of, formats_by_suffix

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanFile:
    """A scan of a file, to be read.

    Attributes:
        path: Of the file.
        name: The scan's, unique in the run.
        part: Which of the file's scans it is, from 0.
    """

    path: Path
    name: str
    part: int = 0

    def read(self) -> RangeScan:
        """Read the scan.

        Raises:
            ReadError: If it cannot be read.
        """
        return read_scan(self.path, self.name, part=self.part)


def collect(inputs: Sequence[Path | str]) -> tuple[ScanFile, ...]:
    """The scans that folders, glob patterns and files name, in natural order of their paths.

    Of a folder (not those inside it) and of a pattern, hidden files and files of unknown formats
    are left out; some formats, such as ``.txt`` and ``.csv``, count only when named, or by a
    pattern that ends so. Only files that may hold several scans are opened. A file that is named
    twice counts once.

    Names are the files' stems; if two share one, all names become paths relative to the common
    parent, without suffix unless that is needed to tell them apart. Several scans of one file are
    called as the file calls them, or ``stem_1``, ``stem_2``; if that is another scan's name too,
    ``stem.suffix/1`` and so on.

    Raises:
        ReadError: If a named file is missing or of an unknown format.
        InputError: If a folder or a pattern holds no scans, or nothing is named.
    """
    if not inputs:
        raise InputError("no scans given; name a folder or files")
    found = {Path(os.path.abspath(path)): path for each in inputs for path in _expand(each)}
    absolute = sorted(found, key=lambda path: natural_key(path.as_posix()))
    stems = dict(zip(absolute, _unique_names(absolute), strict=True))
    parts = [(path, k, own) for path in absolute for k, own in enumerate(_own_names(path))]
    names = [own or stems[path] for path, _, own in parts]
    if len(set(names)) < len(names):
        # A file is no folder, too: this can be no other scan's name.
        names = [
            f"{stems[path].removesuffix(path.suffix)}{path.suffix}/{k + 1}" if own else stems[path]
            for path, k, own in parts
        ]
    return tuple(
        ScanFile(path=found[path], name=printable(name), part=k)
        for (path, k, _), name in zip(parts, names, strict=True)
    )


def _own_names(path: Path) -> list[str]:
    """Of the scans of a file, numbered where it has no names for them; empty if it has but one."""
    names = part_names(path)
    if len(names) == 1:
        return [""]
    return [name or f"{stem_of(path)}_{k}" for k, name in enumerate(names, start=1)]


def _expand(each: Path | str) -> list[Path]:
    path = Path(each)
    if os.path.isdir(path):  # of a name that is too long the methods of Path raise
        try:
            return _scans_among(sorted(path.iterdir()), f"{path}: the folder")
        except OSError as error:
            raise ReadError(f"{path}: cannot be listed ({error.strerror}); check it") from error
    exists = os.path.exists(path)
    if not exists and glob.has_magic(str(each)):
        matches = [Path(match) for match in sorted(glob.glob(str(each)))]
        return _scans_among(matches, f"{each}: the pattern", suffix_of(path))
    if not exists:
        link = os.path.islink(path)
        told = (
            "is a link that leads nowhere; copy the file"
            if link
            else "there is no such file; check the path"
        )
        raise ReadError(f"{path}: {told}")
    if format_of(path) is None:
        raise ReadError(why_unread(path, formats_by_suffix()))
    return [path]


def _scans_among(candidates: list[Path], where: str, named: str = "") -> list[Path]:
    """Those of the files that are scans, and whose suffix need not be named, or is."""
    only_named = {suffix for form in formats_by_suffix().values() for suffix in form.only_named}
    left_out = frozenset(only_named - {named})
    known = [suffix for suffix in formats_by_suffix() if suffix not in left_out]
    scans: list[Path] = []
    others: list[Path] = []
    for path in candidates:
        is_scan = suffix_of(path) in known and not path.name.startswith(".")
        is_dangling = path.is_symlink() and not path.exists()
        if is_scan and (path.is_file() or is_dangling):  # the reader says what is wrong with it
            scans.append(path)
        else:
            others.append(path)
    found = inventory(others, left_out)
    if not scans:
        told = f", but {found}" if found else ""
        formats = ", ".join(known)
        raise InputError(f"{where} holds no scans{told}; scanweld looks for {formats} there")
    if found:
        texts = [path for path in others if suffix_of(path) in left_out]
        is_meant = len(texts) > len(scans) or any(map(foreign_kind, others))
        logger.log(logging.WARNING if is_meant else logging.INFO, "%s also holds %s", where, found)
    return scans


def _unique_names(paths: list[Path]) -> list[str]:
    stems = [stem_of(path) for path in paths]
    if len(set(stems)) == len(stems):
        return stems
    parent = os.path.commonpath([path.parent for path in paths])
    relative = [PurePath(os.path.relpath(path, parent)) for path in paths]
    short = [path.with_name(stem_of(path)).as_posix() for path in relative]
    return short if len(set(short)) == len(short) else [path.as_posix() for path in relative]
