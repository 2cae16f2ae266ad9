"""How many points of a scan, and how many workers, there is room for under a budget of memory."""

import re
from collections.abc import Sequence
from pathlib import Path

from scanweld.errors import BudgetError

MEGABYTE = 2**20
_UNITS = {"": MEGABYTE, "m": MEGABYTE, "mb": MEGABYTE, "g": 2**30, "gb": 2**30}
_SIZE = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([a-z]*)\s*", re.IGNORECASE)

# Measured on runs of 2 to 20 scans of 45 thousand to a million points, and rounded up. The same on
# all machines and for any number of workers, so that what becomes of a scan is the same, too.
BASE = 220 * MEGABYTE
"""What a run takes besides its scans: the interpreter, libraries, compiled kernels,"""
FUSION = 260 * MEGABYTE
"""and, in the end, the fusion of the model."""
PER_SCAN = 8 * MEGABYTE
"""A scan's range image and samples, whatever its points."""
PER_POINT = 110
"""A point that is kept: place, normal, colour, cell of the grid, faces."""
PER_WORKED_POINT = 700
"""A point of a scan that is being prepared, besides, in each worker."""
NUM_PLANNED = 2
"""Workers that there is room for in any case."""
READING = 30 * MEGABYTE
"""What reading a file takes, whatever its size,"""
PER_FILE_BYTE = {".ply": 6, ".stl": 8, ".obj": 9, ".off": 21, ".png": 200}
PER_TEXT_BYTE = 7
"""and for each of its bytes."""
MIN_POINTS = 20_000
"""Scans are thinned to no fewer points: a working range image has about as many."""


def parse_size(text: str) -> int:
    """Bytes of a size such as 800M, 2G or 1500 (megabytes).

    Raises:
        BudgetError: If the text is no size.
    """
    found = _SIZE.fullmatch(text)
    if found is None or found[2].lower() not in _UNITS or float(found[1]) == 0:
        raise BudgetError(f"--memory {text}: is no size; give one such as 2G or 800M")
    return int(float(found[1]) * _UNITS[found[2].lower()])


def points_within(budget: int, files: Sequence[Path]) -> int:
    """Points that each scan may keep, so that reading and the run stay under a budget in bytes.

    Raises:
        BudgetError: If that is too little to work with.
    """
    n = max(len(files), 1)
    kept = BASE + PER_SCAN * n
    phases = (
        (BASE + max(map(_reading, files), default=0), 0),
        (kept, NUM_PLANNED * PER_WORKED_POINT),
        (kept + FUSION, 0),
    )
    least = max(fixed + MIN_POINTS * (PER_POINT * n + each) for fixed, each in phases)
    if budget < least:
        largest = max(map(_size, files), default=0)
        scans = f"{len(files)} scans with files of up to {-(-largest // MEGABYTE)} MB"
        raise BudgetError(
            f"--memory {budget // MEGABYTE}M: is too little for {scans}; "
            f"give at least {-(-least // MEGABYTE)}M, or fewer scans"
        )
    return min((budget - fixed) // (PER_POINT * n + each) for fixed, each in phases)


def workers_within(budget: int, num_points: Sequence[int], asked: int) -> int:
    """How many scans may be prepared at a time, of so many points each: as asked, or fewer."""
    kept = BASE + PER_SCAN * len(num_points) + PER_POINT * sum(num_points)
    each = PER_WORKED_POINT * max(num_points, default=1)
    return max(1, min(asked, (budget - kept) // each))


def _reading(path: Path) -> int:
    """What reading a file takes for a while."""
    return READING + _size(path) * PER_FILE_BYTE.get(path.suffix.lower(), PER_TEXT_BYTE)


def _size(path: Path) -> int:
    return path.stat().st_size if path.is_file() else 0
