"""How many points of a scan there is room for under a budget of memory."""

import re
from collections.abc import Sequence
from pathlib import Path

from scanweld.errors import BudgetError

MEGABYTE = 2**20
_UNITS = {"": MEGABYTE, "m": MEGABYTE, "mb": MEGABYTE, "g": 2**30, "gb": 2**30}
_SIZE = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([a-z]*)\s*", re.IGNORECASE)

# Measured on runs of 6 and 20 scans of 45 thousand to a million points.
BASE = 480 * MEGABYTE
"""What a run takes besides its scans: libraries, compiled kernels, the fusion of the model,"""
READING = 260 * MEGABYTE
"""and what has been taken of it when files are read."""
PER_SCAN = 8 * MEGABYTE
"""A scan's range image and samples, whatever its points."""
PER_POINT = 110
PER_FILE_BYTE = 11
"""A file while it is read, beside its size."""
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
    largest = max((path.stat().st_size for path in files if path.is_file()), default=0)
    fixed = max(BASE + PER_SCAN * len(files), READING + PER_FILE_BYTE * largest)
    least = fixed + MIN_POINTS * PER_POINT * len(files)
    if budget < least:
        scans = f"{len(files)} scans with files of up to {largest / MEGABYTE:.0f} MB"
        raise BudgetError(
            f"--memory {budget // MEGABYTE}M: is too little for {scans}; "
            f"give at least {-(-least // MEGABYTE)}M, or fewer scans"
        )
    return (budget - fixed) // (PER_POINT * max(len(files), 1))
