"""Where compiled kernels are kept: in a folder of their own for each state of their source.

Numba notices that a kernel's own file has changed, but not that a kernel or a constant of another
file has, though that is compiled into it. So the folder's name holds a digest of all these files.
Kernels are made by the ``njit`` of this module: so the folder is known before the first of them.
"""

import atexit
import contextlib
import logging
import os
import re
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numba import from_dtype, types
from numba import njit as njit
from numba.core import config
from platformdirs import user_cache_path

from scanweld.compiled.source import PACKAGE, kernel_digest

logger = logging.getLogger(__name__)

_ARGUMENT = re.compile(r"(\w\d)(?:([rw])(\d))?")
PREFIX = "kernels-"
NUM_KEPT = 3
"""Folders of other states of the source that are kept, the last used ones,"""
KEPT_SECONDS = 24 * 3600
"""and all that were used so recently: a program that still runs may need them."""


def provide_cache(chosen: str = "") -> Path:
    """Tell Numba where to keep compiled kernels.

    Args:
        chosen: A folder that users have chosen. If there is none, or it cannot be written, kernels
            are kept in the user's cache folder, else in the package's own, else in a temporary
            folder for as long as the program runs.

    Returns:
        The folder.
    """
    name = PREFIX + kernel_digest()[:16]
    parents = [user_cache_path("scanweld", appauthor=False), PACKAGE / "__pycache__"]
    for parent in [Path(chosen) / "scanweld", *parents] if chosen else parents:
        folder = parent / name
        if _is_writable(folder):
            _prune(folder)
            break
    else:
        folder = _temporary_folder()
    config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]  # Numba makes it at run time
    return folder


def kept_folder() -> Path:
    """Where compiled code of this state of the source is kept."""
    return Path(config.CACHE_DIR)  # type: ignore[attr-defined]


def kept_names() -> set[str]:
    """The last two parts of the names of all kernels that are kept compiled, as ``icp._refine``."""
    return {path.name.split("-")[0] for path in kept_folder().rglob("*.nbi")}


def types_of(arguments: str) -> tuple[Any, ...]:
    """Numba's types of a kernel's arguments.

    Args:
        arguments: As "i8 f4w2": NumPy's letters for the type, then of an array w or r (may be
            written to, or read only), and how many dimensions it has.
    """
    return tuple(_type_of(*found) for found in _ARGUMENT.findall(arguments))


def _type_of(letters: str, access: str, dimensions: str) -> Any:
    scalar = from_dtype(np.dtype(letters))
    if not access:
        return scalar
    return types.Array(scalar, int(dimensions), "C", readonly=access == "r")


def _is_writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made if need be, and marked as used."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        os.utime(folder)
    except OSError:
        return False
    return True


def _prune(folder: Path) -> None:
    """Remove the folders of earlier states of the source that have not been used for long."""
    others = []
    for other in folder.parent.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):  # another process may be pruning too
            if other != folder:
                others.append((other.stat().st_mtime, other))
    for used, other in sorted(others)[:-NUM_KEPT]:
        if time.time() - used > KEPT_SECONDS:
            shutil.rmtree(other, ignore_errors=True)


def _temporary_folder() -> Path:
    # Not a fixed name under /tmp: others could put code there that would then be run.
    folder = Path(tempfile.mkdtemp(prefix="scanweld-kernels-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    logger.warning(
        "no folder can be written to keep compiled code in, so it is compiled anew in each run; "
        "set NUMBA_CACHE_DIR to a folder that can be written"
    )
    return folder


provide_cache(config.CACHE_DIR)  # type: ignore[attr-defined]
