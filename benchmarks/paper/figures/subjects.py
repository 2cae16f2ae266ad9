"""Single scans that figures show: virtual ones and real ones."""

from functools import lru_cache

from benchmarks.paper.views import data_folder, virtual_scan
from scanweld.config import PrepareConfig
from scanweld.errors import InputError
from scanweld.geometry.prepared import PreparedScan
from scanweld.io import read_scan
from scanweld.preparation import prepare


@lru_cache
def subject(name: str, azimuth_deg: float | None) -> PreparedScan:
    """A virtual scan of an object from an azimuth, or without one a real scan of the bunny.

    Raises:
        InputError: If the file of the scan is missing.
    """
    if azimuth_deg is not None:
        return virtual_scan(name, azimuth_deg).scan
    path = data_folder() / "stanford-bunny" / f"{name}.ply"
    if not path.exists():
        raise InputError(
            f"{path}: is missing; put the scan there or set SCANWELD_DATA to the folder of the data"
        )
    return prepare(read_scan(path), PrepareConfig())
