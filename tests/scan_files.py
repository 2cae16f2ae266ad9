"""The sample files of scans, written for a test, and what a scan of theirs must show."""

from pathlib import Path

import numpy as np

from benchmarks.sample_files import COLUMNS, HOLES, ROWS, SAMPLES, colors, surface
from scanweld.geometry.scan import RangeScan

SEEN = np.isfinite(surface()).all(axis=2)
UNSEEN_NOTE = f"{len(HOLES)} points that are not finite dropped: nothing was seen there"


def write(folder: Path, name: str, data: bytes | None = None) -> Path:
    """A sample, or other bytes, as a file."""
    path = folder / name
    path.write_bytes(SAMPLES[name]() if data is None else data)
    return path


def assert_is_surface(scan: RangeScan) -> None:
    """A scan shows the samples' surface, with its grid."""
    assert scan.grid is not None and scan.grid.shape == (ROWS, COLUMNS)
    np.testing.assert_array_equal(scan.grid >= 0, SEEN)
    assert scan.num_dropped == len(HOLES)
    np.testing.assert_allclose(scan.points[scan.grid[SEEN]], surface()[SEEN], rtol=1e-7)


def assert_has_colors(scan: RangeScan) -> None:
    assert scan.grid is not None and scan.colors is not None
    np.testing.assert_array_equal(
        scan.colors[scan.grid[SEEN]], colors().reshape(ROWS, COLUMNS, 3)[SEEN]
    )


def pcd_of(told: str, *lines: str, viewpoint: str = "0 0 0 1 0 0 0") -> bytes:
    """An ASCII PCD without a grid; ``told`` are its fields, all single precision."""
    count = len(told.split())
    kinds = f"SIZE {'4 ' * count}\nTYPE {'F ' * count}\nWIDTH {len(lines)}\nHEIGHT 1"
    head = f"FIELDS {told}\r\n{kinds}\nVIEWPOINT {viewpoint}\nDATA ascii\n"
    return (head + "\n".join(lines)).encode()
