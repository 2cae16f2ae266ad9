"""Libraries that are not everywhere where the tests run."""

import ctypes
import importlib
from typing import Any

import pytest


def open3d() -> Any:
    """Open3D, which needs a library of the system that may come as a package."""
    try:
        usb = importlib.import_module("libusb_package").get_library_path()
        ctypes.CDLL(str(usb), mode=ctypes.RTLD_GLOBAL)
    except (ImportError, OSError):
        pass
    return pytest.importorskip("open3d", exc_type=ImportError)
