"""All formats of scans: every module beside this one that has a ``FORMAT``."""

from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pathlib import PurePath
from pkgutil import iter_modules
from types import MappingProxyType, ModuleType

from scanweld.io import scan_formats
from scanweld.io.names import suffix_of
from scanweld.io.scan_formats.records import Keeps, ScanFormat

Formats = MappingProxyType[str, ScanFormat]


@cache
def formats_by_suffix() -> Formats:
    """The formats by each of their suffixes, in alphabetical order of the modules."""
    return MappingProxyType(
        {suffix: module.FORMAT for module in _modules() for suffix in module.FORMAT.suffixes}
    )


@cache
def _modules() -> tuple[ModuleType, ...]:
    names = sorted(module.name for module in iter_modules(scan_formats.__path__))
    modules = [import_module(f"{scan_formats.__name__}.{name}") for name in names]
    return tuple(module for module in modules if hasattr(module, "FORMAT"))


def format_of(path: PurePath) -> ScanFormat | None:
    """The format of a file by its name, if it is a known one."""
    return formats_by_suffix().get(suffix_of(path))


def format_rows() -> list[tuple[str, str, str]]:
    """Of every format its suffixes, what it is, and what a scan gets from it besides its points."""
    return [
        (" ".join(module.FORMAT.suffixes), _title(module), _kept(module.FORMAT))
        for module in _modules()
    ]


def formats_markdown() -> str:
    """The same as a table in Markdown."""
    rows = [("files", "format", "kept besides points"), ("---", "---", "---"), *format_rows()]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _title(module: ModuleType) -> str:
    title = (module.__doc__ or "").partition("\n")[0].removesuffix(".")
    extra = module.FORMAT.extra
    return f"{title} (needs scanweld[{extra}])" if extra else title


def _kept(form: ScanFormat) -> str:
    return _listed(keeps.value for keeps in Keeps if keeps in form.keeps)


def _listed(words: Iterable[str]) -> str:
    return ", ".join(words) or "-"
