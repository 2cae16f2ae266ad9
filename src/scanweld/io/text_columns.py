"""What the columns of a text mean: their names, and the scan that they make."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.io.raw import RawScan, noted_bytes
from scanweld.io.text import is_any_number
from scanweld.io.text_encoding import HEAD
from scanweld.io.text_head import axis_name, row_cells

INDEX_NOTE = "first column left out: it counts the points"

_NAMES = {
    "normals": (
        ("nx", "ny", "nz"),
        ("normalx", "normaly", "normalz"),
        ("normals0", "normals1", "normals2"),
    ),
    "colors": (("r", "g", "b"), ("red", "green", "blue"), ("rf", "gf", "bf")),
    "intensity": (("intensity",), ("reflectance",)),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Columns:
    """Numbers (from 0) of the columns that are read; empty where there are none."""

    points: tuple[int, ...]
    normals: tuple[int, ...] = ()
    colors: tuple[int, ...] = ()
    intensity: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()


def columns_by_name(path: Path, names: Sequence[str]) -> Columns:
    """What names say, in small letters and without signs; those that say nothing are ignored.

    Raises:
        ReadError: If a coordinate is named twice.
    """
    axes = [axis_name(name) for name in names]
    for axis in "xyz":
        if axes.count(axis) > 1:
            raise ReadError(f"{path}: two columns are named {axis}; leave one of them")
    found = {role: _places(names, choices) for role, choices in _NAMES.items()}
    points = tuple(axes.index(axis) for axis in "xyz")
    used = {*points, *(place for places in found.values() for place in places)}
    ignored = [name for k, name in enumerate(names) if k not in used and name]
    notes = (f"columns ignored: {', '.join(ignored)}",) if ignored else ()
    return Columns(points=points, notes=notes, **found)


def is_known(name: str) -> bool:
    """Whether a column of this name is read."""
    return axis_name(name) in tuple("xyz") or any(name in c for cs in _NAMES.values() for c in cs)


def without_words(text: bytes, names: Sequence[str]) -> bytes:
    """The text with ``nan`` for the words of columns whose names are not read."""
    first = text[HEAD].splitlines()[:1]
    cells = [cell for line in first for cell in row_cells(line.decode("latin-1"))]
    other = [k for k, name in enumerate(names) if not is_known(name)]
    if len(cells) != len(names) or all(is_any_number(cells[k].encode()) for k in other):
        return text
    rows = (row_cells(line.decode("latin-1")) for line in text.splitlines())
    left = (
        ["nan" if k in other and len(row) == len(names) else row[k] for k in range(len(row))]
        for row in rows
    )
    return "\n".join(map(";".join, left)).encode("latin-1")


def is_index(column: FloatArray) -> bool:
    """Whether a column (N,) counts: 1, 2, 3 and so on, from whatever whole number."""
    if len(column) < 3 or column[0] != np.rint(column[0]):
        return False
    return bool((column[1:] == column[:-1] + 1).all())


def scan_of_columns(table: FloatArray, columns: Columns) -> RawScan:
    """The scan of a table (N, columns); colours on no known scale are left out with a note."""
    colors, intensity = _taken(table, columns.colors), _taken(table, columns.intensity)
    color_bytes, no_colors = noted_bytes("colours", colors, _integer_type(colors))
    intensity_bytes, no_shades = noted_bytes("intensities", intensity, _integer_type(intensity))
    points = _taken(table, columns.points)
    assert points is not None
    return RawScan(
        points=points,
        normals=_taken(table, columns.normals),
        colors=color_bytes,
        intensity=None if intensity_bytes is None else intensity_bytes[:, 0],
        notes=(*columns.notes, *no_colors, *no_shades),
    )


def _places(names: Sequence[str], choices: Sequence[tuple[str, ...]]) -> tuple[int, ...]:
    """Where the first of the choices stands that is there as a whole, each name once."""
    for choice in choices:
        if all(names.count(name) == 1 for name in choice):
            return tuple(names.index(name) for name in choice)
    return ()


def _integer_type(values: FloatArray | None) -> str:
    """The NumPy code of two bytes where whole numbers need them, for ``to_bytes``."""
    if values is None:
        return ""
    return "u2" if (values == np.rint(values)).all() and 255 < values.max() <= 65535 else ""


def _taken(table: FloatArray, places: tuple[int, ...]) -> FloatArray | None:
    """Columns side by side (N, k), not copied where they stand so in the table."""
    if not places:
        return None
    if places == tuple(range(places[0], places[0] + len(places))):
        return table[:, places[0] : places[-1] + 1]
    return table[:, list(places)]
