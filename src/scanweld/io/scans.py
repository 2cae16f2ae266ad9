"""Several scans at once, for use from Python."""

from collections.abc import Sequence
from pathlib import Path

from scanweld.geometry.scan import RangeScan
from scanweld.io.depth.capture import DepthOptions, as_named, collect_named

_NOTHING = DepthOptions()


def read_scans(
    inputs: Path | str | Sequence[Path | str], depth: DepthOptions = _NOTHING
) -> list[RangeScan]:
    """Read all scans of a folder, a glob pattern or a list of files, in natural order.

    Args:
        inputs: What ``scanweld run`` takes: captures of depth cameras, too.
        depth: What is to be said of depth images.

    Raises:
        ScanweldError: If there are none, or one cannot be read.
    """
    named = [inputs] if isinstance(inputs, Path | str) else inputs
    return [file.read() for file in collect_named(as_named(named, depth))]
