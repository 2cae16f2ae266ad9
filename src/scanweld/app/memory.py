"""How many points of a scan, and how many workers, there is room for under a budget of memory."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from scanweld.errors import BudgetError

MEGABYTE = 2**20
_UNITS = {"": MEGABYTE, "m": MEGABYTE, "mb": MEGABYTE, "g": 2**30, "gb": 2**30}
_SIZE = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([a-z]*)\s*", re.IGNORECASE)

NUM_PLANNED = 2
"""Workers that there is room for in any case."""
MIN_POINTS = 20_000
"""Scans are thinned to no fewer points: a working range image has about as many."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Needs:
    """Bytes that a run takes, by what it takes them for.

    Measured on runs of 2 to 20 scans of 45 thousand to a million points, and rounded up. The same
    on all machines and for any number of workers, so that what becomes of a scan is the same, too.

    Attributes:
        run: Besides its scans: the interpreter, libraries, compiled kernels.
        fusion: Of the model, in the end.
        scan: Its range image and samples, whatever its points.
        point: That is kept: place, normal, colour, cell of the grid, faces.
        worked_point: Of a scan that is being prepared, besides, in each worker.
        file: That is read, whatever its size.
        file_byte: Each of its bytes, by suffix.
        text_byte: Likewise of all other files.
    """

    run: int = 220 * MEGABYTE
    fusion: int = 260 * MEGABYTE
    scan: int = 8 * MEGABYTE
    point: int = 110
    worked_point: int = 700
    file: int = 30 * MEGABYTE
    file_byte: Mapping[str, int] = field(
        default_factory=lambda: {".ply": 6, ".stl": 8, ".obj": 9, ".off": 21, ".png": 200}
    )
    text_byte: int = 7


NEEDS = Needs()


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
    kept = NEEDS.run + NEEDS.scan * n
    phases = (
        (NEEDS.run + max(map(_reading, files), default=0), 0),
        (kept, NUM_PLANNED * NEEDS.worked_point),
        (kept + NEEDS.fusion, 0),
    )
    least = max(fixed + MIN_POINTS * (NEEDS.point * n + each) for fixed, each in phases)
    if budget < least:
        largest = max(map(_size, files), default=0)
        scans = f"{len(files)} scans with files of up to {-(-largest // MEGABYTE)} MB"
        raise BudgetError(
            f"--memory {budget // MEGABYTE}M: is too little for {scans}; "
            f"give at least {-(-least // MEGABYTE)}M, or fewer scans"
        )
    return min((budget - fixed) // (NEEDS.point * n + each) for fixed, each in phases)


def workers_within(budget: int, num_points: Sequence[int], asked: int) -> int:
    """How many scans may be prepared at a time, of so many points each: as asked, or fewer."""
    kept = NEEDS.run + NEEDS.scan * len(num_points) + NEEDS.point * sum(num_points)
    each = NEEDS.worked_point * max(num_points, default=1)
    return max(1, min(asked, (budget - kept) // each))


def _reading(path: Path) -> int:
    """What reading a file takes for a while."""
    return NEEDS.file + _size(path) * NEEDS.file_byte.get(path.suffix.lower(), NEEDS.text_byte)


def _size(path: Path) -> int:
    return path.stat().st_size if path.is_file() else 0
