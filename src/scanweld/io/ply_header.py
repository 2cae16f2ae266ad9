"""The header of a PLY file: which elements its body holds, in which types and order."""

import logging
import re
from dataclasses import dataclass
from pathlib import Path

from scanweld.errors import ReadError

logger = logging.getLogger(__name__)

SCALAR_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"int64": "i8", "uint64": "u8", "float": "f4", "double": "f8"},
    **{"float32": "f4", "float64": "f8"},
}
"""Both spellings of every scalar type -> NumPy's code without the byte order."""
_FIRST_LINE = re.compile(rb"ply[ \t]*(\r\n|\n|\r)")
_COUNT = re.compile(r"[0-9]{1,15}")
FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")


@dataclass(frozen=True, kw_only=True, slots=True)
class PlyProperty:
    """A property: NumPy codes of its values and, for a list, of the length before them."""

    name: str
    type: str
    count_type: str | None = None

    @property
    def is_list(self) -> bool:
        """Whether each row holds a list of values."""
        return self.count_type is not None


@dataclass(frozen=True, kw_only=True, slots=True)
class PlyElement:
    """An element: so many rows with these properties in this order."""

    name: str
    count: int
    properties: tuple[PlyProperty, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class PlyHeader:
    """All that stands before ``end_header``, and where the body begins.

    Attributes:
        path: The file, for messages.
        format: ``ascii``, ``binary_little_endian`` or ``binary_big_endian``.
        elements: In the order of the body.
        info: ``obj_info`` entries, first word -> the rest of the line.
        comments: ``comment`` lines.
        body_start: Offset of the body in bytes.
    """

    path: Path
    format: str
    elements: tuple[PlyElement, ...]
    info: dict[str, str]
    comments: tuple[str, ...]
    body_start: int

    def element(self, name: str) -> PlyElement | None:
        """The element of that name, if there is one."""
        return next((element for element in self.elements if element.name == name), None)


def parse_header(path: Path, data: bytes) -> PlyHeader:
    """Parse the header of a PLY file's bytes; lines end in LF, CRLF or CR.

    Lines that begin with no PLY keyword are skipped (six scans of the Stanford dragon have some).

    Raises:
        ReadError: If the data does not begin with a PLY header.
    """
    lines, body_start = _header_lines(path, data)
    form: str | None = None
    info: dict[str, str] = {}
    comments: list[str] = []
    elements: list[tuple[str, int, list[PlyProperty]]] = []
    for line in lines:
        keyword, *words = line.split() or [""]
        if keyword == "format":
            form = words[0] if words else None
        elif keyword == "obj_info":
            info[words[0] if words else ""] = " ".join(words[1:])
        elif keyword == "comment":
            comments.append(line.removeprefix("comment").strip())
        elif keyword == "element":
            elements.append(_element(path, line, words))
            if [name for name, _, _ in elements].count(words[0]) > 1:
                raise ReadError(f"{path}: two elements are called {words[0]}; export the file anew")
        elif keyword == "property":
            if not elements:
                raise ReadError(f"{path}: '{line}' stands before any element; export the file anew")
            known = elements[-1][2]
            known.append(_property(path, line, words, {prop.name for prop in known}))
        elif keyword:
            logger.debug("%s: header line %r skipped", path, line)
    if form not in FORMATS:
        raise ReadError(
            f"{path}: unknown PLY format {form!r}; save it as one of {', '.join(FORMATS)}"
        )
    return PlyHeader(
        path=path,
        format=form,
        elements=tuple(
            PlyElement(name=name, count=count, properties=tuple(properties))
            for name, count, properties in elements
        ),
        info=info,
        comments=tuple(comments),
        body_start=body_start,
    )


def _header_lines(path: Path, data: bytes) -> tuple[list[str], int]:
    """The lines between ``ply`` and ``end_header``, and where the body begins."""
    if not data:
        raise ReadError(f"{path}: the file is empty; copy it again or leave it out")
    # The first line tells the line ending: the first bytes of a binary body may look like one.
    first = _FIRST_LINE.match(data)
    if first is None:
        raise ReadError(f"{path}: not a PLY file (it does not begin with 'ply'); leave it out")
    newline = b"\r" if first[1] == b"\r" else b"\n"
    end = data.find(newline + b"end_header")
    if end < 0:
        raise ReadError(
            f"{path}: the header has no 'end_header', the file is cut off; copy it again"
        )
    after = data.find(newline, end + 1)
    body_start = len(data) if after < 0 else after + 1
    text = data[first.end() : max(first.end(), end)].decode("utf-8", errors="replace")
    return [line.strip() for line in text.split(newline.decode())], body_start


def _element(path: Path, line: str, words: list[str]) -> tuple[str, int, list[PlyProperty]]:
    if len(words) != 2 or not _COUNT.fullmatch(words[1]):
        raise ReadError(f"{path}: '{line}' is not 'element NAME COUNT'; export the file anew")
    return words[0], int(words[1]), []


def _property(path: Path, line: str, words: list[str], taken: set[str]) -> PlyProperty:
    """A property, its name in small letters unless one of the element's is called so."""
    name = words[-1].lower() if words else ""
    name = words[-1] if name in taken else name
    types = [SCALAR_TYPES.get(word) for word in words[:-1]]
    if len(words) == 2 and types[0] is not None:
        return PlyProperty(name=name, type=types[0])
    if len(words) == 4 and words[0] == "list" and types[1] is not None and types[2] is not None:
        return PlyProperty(name=name, type=types[2], count_type=types[1])
    raise ReadError(f"{path}: '{line}' is not a property of a known type; export the file anew")
