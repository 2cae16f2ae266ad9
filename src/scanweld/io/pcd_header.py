"""The header of a PCD file: its fields, its size, and where its sensor stood."""

import re
from dataclasses import dataclass
from pathlib import Path

from scanweld.errors import ReadError
from scanweld.io.text import is_number

_DATA = re.compile(rb"^[ \t]*DATA[ \t]+(\w+)[ \t]*(\r\n|\n|\r|$)", re.MULTILINE)
_COUNT = re.compile(r"\d{1,15}")
_TYPES = {**dict.fromkeys("IU", (1, 2, 4, 8)), "F": (2, 4, 8)}
ENCODINGS = ("ascii", "binary", "binary_compressed")


@dataclass(frozen=True, kw_only=True, slots=True)
class PcdField:
    """A field: NumPy's code of its values, and how many of them a point has."""

    name: str
    type: str
    count: int

    @property
    def size(self) -> int:
        """Bytes of a point."""
        return int(self.type[1:]) * self.count


@dataclass(frozen=True, kw_only=True, slots=True)
class PcdHeader:
    """All that stands before the points.

    Attributes:
        fields: In the order of the body; those called ``_`` are padding.
        width: Points in a row, or all of them.
        height: Rows; 1 where there is no grid.
        viewpoint: (7,) place and quaternion w x y z of the sensor; empty if it is not told.
        encoding: One of ``ENCODINGS``.
        body_start: Offset of the body in bytes.
    """

    fields: tuple[PcdField, ...]
    width: int
    height: int
    viewpoint: tuple[float, ...]
    encoding: str
    body_start: int

    @property
    def num_points(self) -> int:
        """Points, those that say nothing included."""
        return self.width * self.height


def parse_pcd_header(path: Path, data: bytes) -> PcdHeader:
    """Parse the header of a PCD file's bytes.

    Raises:
        ReadError: If it is none, or contradicts itself.
    """
    end = _DATA.search(data)
    if end is None:
        raise ReadError(f"{path}: not a PCD file, its header has no line DATA; copy it again")
    entries: dict[str, list[str]] = {}
    for line in data[: end.start()].decode("utf-8", errors="replace").splitlines():
        keyword, *words = line.partition("#")[0].split() or [""]
        if keyword:
            entries[keyword.upper()] = words
    encoding = end[1].decode("ascii", errors="replace").lower()
    if encoding not in ENCODINGS:
        raise ReadError(
            f"{path}: unknown DATA {encoding!r}; save it as one of {', '.join(ENCODINGS)}"
        )
    points = _one(path, entries, "POINTS") if "POINTS" in entries else None
    width = points if "WIDTH" not in entries else _one(path, entries, "WIDTH")
    height = _one(path, entries, "HEIGHT") if "HEIGHT" in entries else 1
    if width is None or points not in (None, width * height):
        raise ReadError(
            f"{path}: WIDTH x HEIGHT is not the number of POINTS in its header; export it anew"
        )
    if not width * height:
        raise ReadError(f"{path}: holds no points; leave it out")
    viewpoint = entries.get("VIEWPOINT", [])
    if len(viewpoint) not in (0, 7) or not all(is_number(word.encode()) for word in viewpoint):
        raise ReadError(f"{path}: its VIEWPOINT is not 7 numbers; correct or remove the line")
    return PcdHeader(
        fields=_fields(path, entries),
        width=width,
        height=height,
        viewpoint=tuple(map(float, viewpoint)),
        encoding=encoding,
        body_start=end.end(),
    )


def _fields(path: Path, entries: dict[str, list[str]]) -> tuple[PcdField, ...]:
    names = entries.get("FIELDS") or entries.get("COLUMNS") or []
    sizes, types = entries.get("SIZE", ["4"] * len(names)), entries.get("TYPE", ["F"] * len(names))
    counts = entries.get("COUNT", ["1"] * len(names))
    if not names or not len(names) == len(sizes) == len(types) == len(counts):
        raise ReadError(
            f"{path}: its header has not as many SIZE, TYPE and COUNT as FIELDS; export it anew"
        )
    if any([name.lower() for name in names].count(axis) > 1 for axis in "xyz"):
        raise ReadError(f"{path}: two of its FIELDS are called x, y or z; leave one of them")
    fields = []
    for name, size, kind, count in zip(names, sizes, types, counts, strict=True):
        if (
            size not in map(str, _TYPES.get(kind.upper(), ()))
            or not _COUNT.fullmatch(count)
            or not int(count)
        ):
            raise ReadError(
                f"{path}: its field {name} is of TYPE {kind}, SIZE {size} and COUNT {count}, which "
                "no PCD file has; export it anew"
            )
        code = kind.lower() + size
        fields.append(PcdField(name=name.lower(), type=code, count=int(count)))
    return tuple(fields)


def _one(path: Path, entries: dict[str, list[str]], key: str) -> int:
    words = entries[key]
    if len(words) != 1 or not _COUNT.fullmatch(words[0]):
        raise ReadError(f"{path}: its {key} is not a number; export it anew")
    return int(words[0])
