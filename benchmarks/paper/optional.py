"""Libraries that only the paper study needs, imported when they are first used."""

from importlib import import_module
from types import ModuleType

from scanweld.errors import InputError


def need(module: str) -> ModuleType:
    """Import an optional module, such as ``open3d``.

    Raises:
        InputError: If it is not installed; the message says how to get it.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        raise InputError(
            f"{error.name} is not installed: pip install 'scanweld[bench]' brings it"
        ) from error
