"""One door for all formats: ``read_scan`` and ``read_mesh``.

What overflows or is no number while bytes of any kind are read is not warned of, but dropped or
refused, as all that is not finite.
"""

import codecs
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.scan import RangeScan
from scanweld.io.local_origin import SHIFT_KEY, told_shift
from scanweld.io.misnamed import what_it_is
from scanweld.io.names import is_gzipped, stem_of, suffix_of
from scanweld.io.not_scans import why_unread
from scanweld.io.raw import RawScan, to_mesh, to_scan
from scanweld.io.scan_formats.records import Keeps, Part
from scanweld.io.scan_formats.registry import format_of, formats_by_suffix
from scanweld.io.text_encoding import BEGIN
from scanweld.io.unpack import gunzip

_any_bits = np.errstate(over="ignore", invalid="ignore")


@_any_bits
def read_scan(path: Path | str, name: str | None = None, *, part: int = 0) -> RangeScan:
    """Read a file as one scan, in the coordinates and the unit of the file.

    Args:
        path: A file in any of the formats that ``scanweld formats`` lists.
        name: The scan's name; the file's stem if not given.
        part: Which of its scans, from 0, where a file holds several.

    Raises:
        ReadError: If the file cannot be read as a scan; the message says why and what to do.
    """
    path = Path(path)
    parts = _parts(path)
    if not 0 <= part < len(parts):
        raise ReadError(f"{path}: has no scan {part + 1}, but {len(parts)}; was it changed?")
    return to_scan(path, stem_of(path) if name is None else name, parts[part].read())


@_any_bits
def read_mesh(path: Path | str) -> TriangleMesh:
    """Read a file as a triangle mesh; polygons become fans of triangles.

    Raises:
        ReadError: If the file cannot be read or has no faces.
    """
    path = Path(path)
    return to_mesh(path, _parts(path)[0].read())


@_any_bits
def part_names(path: Path) -> tuple[str, ...]:
    """What a file calls its scans, empty where it does not; of one that is broken, one such name.

    Only files whose format can hold several scans are opened.
    """
    form = format_of(path)
    if form is None or Keeps.SCANS not in form.keeps:
        return ("",)
    try:
        return tuple(part.name for part in _parts(path))
    except ReadError:  # reading says what is wrong
        return ("",)


def _parts(path: Path) -> Sequence[Part]:
    """The scans of a file, at least one."""
    form = format_of(path)
    if form is None:
        raise ReadError(why_unread(path, formats_by_suffix()))
    if form.opens_path and is_gzipped(path):
        raise ReadError(f"{path}: {suffix_of(path)} is not read packed; unpack it with gunzip")
    try:
        data = b"" if form.opens_path else path.read_bytes()
        is_empty = not path.stat().st_size
    except OSError as error:
        raise ReadError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if is_empty:
        raise ReadError(f"{path}: the file is empty; copy it again or leave it out")
    data = gunzip(path, data) if is_gzipped(path) else data
    data = data.removeprefix(codecs.BOM_UTF8)
    try:
        found = form.read(path, data)
    except ReadError as error:
        begin = _first_bytes(path) if form.opens_path else data[BEGIN]
        if told := what_it_is(path, begin):
            raise ReadError(f"{path}: {told}") from error
        raise
    parts = [Part(read=lambda: found)] if isinstance(found, RawScan) else found
    if not parts:
        raise ReadError(f"{path}: holds no scans; leave it out")
    shift = _told_shift(path, data)
    return parts if shift is None else [_moved(part, shift) for part in parts]


def _first_bytes(path: Path) -> bytes:
    """Those of a file that its reader opens itself."""
    with path.open("rb") as stream:
        return stream.read(BEGIN.stop)


def _told_shift(path: Path, data: bytes) -> FloatArray | None:
    """What scanweld wrote about a local origin: how far from it the world's lies."""
    try:
        return told_shift(data)
    except ValueError as error:
        raise ReadError(
            f"{path}: its {SHIFT_KEY} is not three numbers ({error}); correct or remove it"
        ) from error


def _moved(part: Part, shift: FloatArray) -> Part:
    """The same scan, where it belongs."""

    def read() -> RawScan:
        raw = part.read()
        return replace(raw, points=raw.points + shift)

    return replace(part, read=read)
