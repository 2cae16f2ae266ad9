"""Several scans at once, for use from Python."""

from collections.abc import Sequence
from pathlib import Path

from scanweld.geometry.scan import RangeScan
from scanweld.io.collect import collect


def read_scans(inputs: Path | str | Sequence[Path | str]) -> list[RangeScan]:
    """Read all scans of a folder, a glob pattern or a list of files, in natural order.

    Raises:
        ScanweldError: If there are none, or one cannot be read.
    """
    named = [inputs] if isinstance(inputs, Path | str) else inputs
    return [file.read() for file in collect(named)]
