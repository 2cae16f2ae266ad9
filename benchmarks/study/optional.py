"""Libraries that only the benchmarks compare with: the extra ``bench``."""

from importlib import import_module
from types import ModuleType

from scanweld.errors import InputError


def need(module: str) -> ModuleType:
    """A library of the extra ``bench``.

    Raises:
        InputError: If it is not installed, or needs a library of the system that is not there
            (Open3D: libusb, libGL, libX11); the message says how to install it.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise InputError(f"{module} is not installed: run pip install 'scanweld[bench]'") from error
    except ImportError as error:
        raise InputError(
            f"{module} cannot be loaded ({error}): install that library with the system's packages"
        ) from error


def is_usable(module: str) -> bool:
    """Whether a library is there and can be loaded."""
    try:
        need(module)
    except InputError:
        return False
    return True
