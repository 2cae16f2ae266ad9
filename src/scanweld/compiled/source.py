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
    contents = {path: path.read_bytes() for path in _python_files(package)}
    modules = {_module(path.relative_to(package.parent)): path for path in contents}
    found: set[Path] = set()
    left = [path for path, content in contents.items() if b"njit" in content]
    while left:
        path = left.pop()
        if path not in found:
            found.add(path)
            names = _imports(contents[path].decode("utf-8"))
            left += [modules[name] for name in names if name in modules]
    return found


def _module(place: Path) -> str:
    """The full name of a module, or of a package, by its place below the folder of them all."""
    parts = place.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _python_files(package: Path) -> Iterator[Path]:
    return package.rglob("*.py")


def _digest(package: Path, files: Iterable[Path]) -> str:
    """Of the files' places inside the package and their contents."""
    total = hashlib.sha256()
    for name, path in sorted((path.relative_to(package).as_posix(), path) for path in files):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        total.update(f"{name} {content}\n".encode())
    return total.hexdigest()


def _imports(text: str) -> Iterator[str]:
    """The full names of all that may be a module among what a file imports."""
    for module, names in _IMPORT.findall(text):
        yield module
        for name in _NAME.findall(names):
            yield f"{module}.{name}"
