"""One door for all formats: ``read_scan`` and ``read_mesh``."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from scanweld.errors import ReadError
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.scan import RangeScan
from scanweld.io.local_origin import SHIFT_KEY, told_shift
from scanweld.io.mesh_formats import read_obj, read_off, read_stl
from scanweld.io.not_scans import why_unread
from scanweld.io.ply import read_ply
from scanweld.io.raw import RawScan, to_mesh, to_scan
from scanweld.io.xyz import read_xyz

Reader = Callable[[Path, bytes], RawScan]

READERS: dict[str, Reader] = {
    **{".ply": read_ply, ".obj": read_obj, ".off": read_off, ".stl": read_stl},
    **dict.fromkeys((".xyz", ".pts", ".asc", ".txt", ".csv"), read_xyz),
}
"""Suffix in lower case -> reader."""


def read_scan(path: Path | str, name: str | None = None) -> RangeScan:
    """Read a file as one scan, in the coordinates and the unit of the file.

    Args:
        path: A PLY file, a mesh (OBJ, OFF, STL) or text (XYZ, PTS, ASC, TXT, CSV).
        name: The scan's name; the file's stem if not given.

    Raises:
        ReadError: If the file cannot be read as a scan; the message says why and what to do.
    """
    path = Path(path)
    return to_scan(path, path.stem if name is None else name, _read(path))


def read_mesh(path: Path | str) -> TriangleMesh:
    """Read a file as a triangle mesh; polygons become fans of triangles.

    Raises:
        ReadError: If the file cannot be read or has no faces.
    """
    path = Path(path)
    return to_mesh(path, _read(path))


def _read(path: Path) -> RawScan:
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ReadError(why_unread(path, READERS))
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ReadError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if not data:
        raise ReadError(f"{path}: the file is empty; copy it again or leave it out")
    return in_world(path, data, reader(path, data))


def in_world(path: Path, data: bytes, raw: RawScan) -> RawScan:
    """What scanweld wrote about a local origin, moved back to where it belongs.

    Args:
        path: Of the file, for messages.
        data: Its bytes.
        raw: What they hold.

    Raises:
        ReadError: If the file's shift is no three numbers.
    """
    try:
        shift = told_shift(data)
    except ValueError as error:
        raise ReadError(
            f"{path}: its {SHIFT_KEY} is not three numbers ({error}); correct or remove it"
        ) from error
    return raw if shift is None else replace(raw, points=raw.points + shift)
