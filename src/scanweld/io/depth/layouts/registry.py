"""All layouts: every module beside this one that has a ``LAYOUT``."""

from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

from scanweld.errors import InputError
from scanweld.io.depth import layouts
from scanweld.io.depth.layouts.records import Layout


@cache
def _modules() -> tuple[ModuleType, ...]:
    names = sorted(module.name for module in iter_modules(layouts.__path__))
    modules = [import_module(f"{layouts.__name__}.{name}") for name in names]
    return tuple(module for module in modules if hasattr(module, "LAYOUT"))


def layout_of(folder: Path) -> Layout | None:
    """The layout that a folder has, if it has one.

    Raises:
        InputError: If it has several.
    """
    found = [module.LAYOUT for module in _modules() if module.LAYOUT.recognise(folder)]
    if len(found) > 1:
        told = " and ".join(f"{layout.name} ({layout.files})" for layout in found)
        raise InputError(f"{folder}: has the files of {told}; take away those of one of them")
    return found[0] if found else None


def layout_rows() -> list[tuple[str, ...]]:
    """Of every layout what it is, its files, and where cameras, scale, poses and colours are."""
    return [
        (
            (module.__doc__ or "").partition("\n")[0].removesuffix("."),
            *(getattr(module.LAYOUT, key) for key in _COLUMNS),
        )
        for module in _modules()
    ]


_COLUMNS = ("files", "cameras", "scale", "poses", "colors")


def layouts_markdown() -> str:
    """The same as a table in Markdown."""
    head = ("layout", "recognised by", "intrinsics", "scale", "start poses", "colours")
    rows = [head, ("---",) * len(head), *layout_rows()]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)
