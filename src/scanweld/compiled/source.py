"""Digests of the package's own source: work is kept under them, and done anew when code changes."""

import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
# Text is searched, as parsing so many files at each start takes longer than most else of it.
_IMPORT = re.compile(r"^\s*(?:from|import) +([\w.]+)(?: +import +(\([^)]*\)|.*))?", re.MULTILINE)
_NAME = re.compile(r"\w+")


@cache
def code_digest(package: Path = PACKAGE) -> str:
    """Hex digest of all Python files of a package."""
    return _digest(package, _python_files(package))


@cache
def kernel_digest(package: Path = PACKAGE) -> str:
    """Hex digest of all that compiled kernels are made of.

    These are the files that define kernels, and all files of the package that they import: a
    compiled kernel holds the kernels it calls and the constants it reads.
    """
    return _digest(package, kernel_files(package))


def kernel_files(package: Path = PACKAGE) -> set[Path]:
    """The files of a package that define kernels, and those that they import, and so on."""
    files = set(_python_files(package))
    found: set[Path] = set()
    left = [path for path in files if b"njit" in path.read_bytes()]
    while left:
        path = left.pop()
        if path not in found:
            found.add(path)
            left += [other for other in _imports(path, package) if other in files]
    return found


def _python_files(package: Path) -> Iterator[Path]:
    return package.rglob("*.py")


def _digest(package: Path, files: Iterable[Path]) -> str:
    """Of the files' places inside the package and their contents."""
    total = hashlib.sha256()
    for name, path in sorted((path.relative_to(package).as_posix(), path) for path in files):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        total.update(f"{name} {content}\n".encode())
    return total.hexdigest()


def _imports(path: Path, package: Path) -> Iterator[Path]:
    """Where the modules are that a file imports by their full names, if they are of the package."""
    for module, names in _IMPORT.findall(path.read_text(encoding="utf-8")):
        for name in [module, *(f"{module}.{name}" for name in _NAME.findall(names))]:
            parts = name.split(".")
            if parts[0] == package.name:
                place = package.joinpath(*parts[1:])
                yield place.with_suffix(".py")
                yield place / "__init__.py"
