"""LAS and LAZ of ASPRS: points, with colours or intensity."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray
from scanweld.io.raw import RawScan, side_by_side, to_bytes
from scanweld.io.scan_formats.records import Keeps, ScanFormat, needed
from scanweld.io.unpack import MOST_EXPANSION, SMALL

_UNCHUNKED = b"\1\0"
"""How the record of the packing begins where the points are one piece."""


def read_las(path: Path, data: bytes) -> RawScan:
    """The points of a LAS or LAZ file, scaled and shifted as it says, in double precision.

    Raises:
        ReadError: If laspy is not installed, or the file is broken.
    """
    laspy = needed(path, "laspy", "las")
    _check_records(path, data)
    try:
        # Of the two, the parallel one believes the table of packed pieces and ends the process.
        with laspy.open(BytesIO(data), laz_backend=laspy.LazBackend.Lazrs) as reader:
            header = reader.header
            size = header.point_count * header.point_format.size
            _check_packing(path, data, header)
            if size > max(SMALL, MOST_EXPANSION * len(data)):
                raise ReadError(
                    f"{path}: says {header.point_count} points, more than it can hold; copy it "
                    "again"
                )
            found = reader.read()
        points = side_by_side([found.x, found.y, found.z])
        names = set(found.point_format.dimension_names)
        colors = _colors(found) if {"red", "green", "blue"} <= names else None
        intensity = _shades(np.asarray(found.intensity)) if "intensity" in names else None
    except ReadError:
        raise
    # What lies below laspy is written in Rust: its panics are no Exception.
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        told = " ".join(str(error).split())[:100]
        raise ReadError(
            f"{path}: not a LAS or LAZ file, or a broken one ({told}); copy it again or export "
            "it anew"
        ) from error
    if len(points) != header.point_count:
        raise ReadError(
            f"{path}: holds {len(points)} points but says {header.point_count} (truncated, or a "
            "wrong count); copy it again"
        )
    return RawScan(points=points, colors=colors, intensity=intensity)


def _check_records(path: Path, data: bytes) -> None:
    """Refuse a file that says it has more records than it has room for: laspy would read on.

    Offsets as in the LAS specification, 1.2 to 1.4.
    """
    count, num_extended = int.from_bytes(data[100:104], "little"), 0
    if len(data) >= 247 and data[25] >= 4:
        num_extended = int.from_bytes(data[243:247], "little")
    is_cut = len(data) < 227 or not data.startswith(b"LASF") or _start(data) > len(data)
    if is_cut or 54 * count + 60 * num_extended > len(data):
        raise _too_long(path)


def _start(data: bytes) -> int:
    return int.from_bytes(data[96:100], "little")


def _too_long(path: Path) -> ReadError:
    return ReadError(
        f"{path}: not a LAS or LAZ file, or a broken one (its records are longer than it); copy it "
        "again or export it anew"
    )


def _check_packing(path: Path, data: bytes, header: Any) -> None:
    """Refuse a packed file at which what lies below laspy would panic, and print that it does."""
    packing = needed(path, "laspy", "las").vlrs.known.LasZipVlr.official_record_ids()
    told = [vlr.record_data_bytes() for vlr in header.vlrs if vlr.record_id in packing]
    if any(record[:2] == _UNCHUNKED for record in told):
        raise ReadError(f"{path}: is packed without chunks, as LASzip 1 did; unpack it to LAS")
    if _num_chunks(data, _start(data)) > len(data):
        raise _too_long(path)


def _num_chunks(data: bytes, start: int) -> int:
    """Packed pieces that a LAZ file says it has; more than its bytes if it cannot say where.

    The points begin with the place of the table of pieces, or it stands in the last eight bytes.
    """
    if not data[104] & 128:
        return 0
    table = int.from_bytes(data[start : start + 8], "little", signed=True)
    if table == -1:
        table = int.from_bytes(data[-8:], "little", signed=True)
    if not start + 8 <= table <= len(data) - 8:
        return len(data) + 1
    return int.from_bytes(data[table + 4 : table + 8], "little")


def _colors(found: object) -> ByteArray | None:
    channels = [np.asarray(getattr(found, name)) for name in ("red", "green", "blue")]
    return to_bytes(np.stack(channels, axis=1), "u2")


def _shades(values: np.ndarray) -> ByteArray | None:
    """Intensities as grey; none where all are the same, as where nothing was measured."""
    return to_bytes(values, "u2") if len(values) and values.min() < values.max() else None


FORMAT = ScanFormat(
    suffixes=(".las", ".laz"),
    read=read_las,
    keeps=(Keeps.COLORS,),
    extra="las",
    begins=(b"LASF",),
)
