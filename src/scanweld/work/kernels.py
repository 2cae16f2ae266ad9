"""A place for compiled kernels where neither the package nor the user's cache can be written.

Numba keeps what it compiled beside the source, else in the user's cache folder. Where it can write
to neither (a service's account, a read-only container), it fails on import. Importing this module
before any that holds a kernel puts the cache into a temporary folder then.
"""

import atexit
import logging
import shutil
import tempfile

import numba
from numba.core import config

logger = logging.getLogger(__name__)


def provide_cache() -> str | None:
    """Make sure that Numba can keep kernels; returns the temporary folder if one was needed."""
    try:
        numba.njit(cache=True)(_nothing)
    except RuntimeError:
        # Not a fixed name under /tmp: others could put code there that would then be run.
        folder = tempfile.mkdtemp(prefix="scanweld-kernels-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        config.CACHE_DIR = folder  # type: ignore[attr-defined]  # Numba makes it at run time
        logger.warning(
            "no folder to keep compiled code in, so it is compiled anew in each run; "
            "set NUMBA_CACHE_DIR to a folder that can be written"
        )
        return folder
    return None


def _nothing() -> None:
    """A function to try the cache with."""


provide_cache()
