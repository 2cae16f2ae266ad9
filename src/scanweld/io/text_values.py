"""What the columns of a text can be, and nothing else, where there are no names."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.io.names import suffix_of
from scanweld.io.text_columns import INDEX_NOTE, Columns, is_index

_MOST_COLUMNS = 12
"""Wider texts without column names are tables of something else."""
_FEW_ROWS = 8
"""Coordinates of fewer points rise one after the other by chance."""


def columns_by_values(path: Path, table: FloatArray) -> Columns:
    """What columns without names can be, and nothing else; x, y and z come first.

    Raises:
        ReadError: If it is not certain that x, y and z come first.
    """
    width = table.shape[1]
    first = int(width > 3 and is_index(table[:, 0]))
    if reason := _why_not_points(table[:, first:]):
        raise ReadError(
            f"{path}: {reason}; write the columns' names above them, such as x y z nx ny nz r g b"
        )
    places = range(first + 3, width)
    notes = [INDEX_NOTE] if first else []
    if suffix_of(path) == ".pts" and len(places) in (1, 4):
        colors = tuple(places[1:]) if len(places) == 4 and _are_colors(table[:, -3:]) else ()
        return Columns(points=tuple(range(first, first + 3)), colors=colors, intensity=(places[0],))
    normals = _only(table, places, _are_unit_vectors)
    colors = _only(table, [k for k in places if k not in normals], _are_colors)
    ignored = [str(k + 1) for k in places if k not in (*normals, *colors)]
    for what, found in (("unit normals", normals), ("colours", colors)):
        notes += [f"columns {found[0] + 1} to {found[-1] + 1} read as {what}"] if found else []
    if ignored:
        word = "columns" if len(ignored) > 1 else "column"
        notes.append(f"{word} ignored, as there are no names: {', '.join(ignored)}")
    points = tuple(range(first, first + 3))
    return Columns(points=points, normals=normals, colors=colors, notes=tuple(notes))


def _why_not_points(table: FloatArray) -> str:
    """Why it is not certain that the first three columns (N, width) are x, y and z."""
    width = table.shape[1]
    if width < 3:
        return f"{width} columns where x, y and z are three"
    if width > _MOST_COLUMNS:
        return f"{width} columns without names"
    if width > 3 and len(table) >= _FEW_ROWS and _only_rises(table[:, 0]):
        return "its first column only rises and may be x, a number of the point, or a time"
    if width < 5 or (width > 5 and _is_triple(table[:, 3:6])):
        return ""
    if width > 5 and _is_triple(table[:, :3]):
        return "its first three columns may be normals or colours, with x, y and z behind them"
    if _are_pixels(table):
        return "its first two columns may be x and y, or the row and column of a pixel"
    return ""


def _is_triple(values: FloatArray) -> bool:
    return _are_unit_vectors(values) or _are_colors(values)


def _are_pixels(table: FloatArray) -> bool:
    """Whether the first two columns may number pixels whose points follow."""
    first, behind = table[:, :2], table[:, 3:5]
    are_whole = bool((first == np.rint(first)).all()) and bool((first >= 0).all())
    return are_whole and bool((behind != np.rint(behind)).any(axis=0).all())


def _only(
    table: FloatArray, places: Sequence[int], is_kind: Callable[[FloatArray], bool]
) -> tuple[int, ...]:
    """The three columns next to each other that are of a kind, if no other three are."""
    runs = [tuple(places[k : k + 3]) for k in range(len(places) - 2)]
    found = [run for run in runs if run[2] - run[0] == 2 and is_kind(table[:, run[0] : run[0] + 3])]
    return found[0] if len(found) == 1 else ()


def _are_colors(values: FloatArray) -> bool:
    """Whether values (N, 3) are whole numbers from 0 to 255, and not all 0 or 1."""
    lowest, highest = values.min(), values.max()
    return bool(lowest >= 0 and 1 < highest <= 255 and (values == np.rint(values)).all())


def _are_unit_vectors(vectors: FloatArray) -> bool:
    """Whether all vectors (N, 3) are of length 1, to two digits, or zero (unknown)."""
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(vectors[(vectors != 0).any(axis=1)], axis=1)
    lengths = lengths[np.isfinite(lengths)]
    return len(lengths) > 0 and bool((np.abs(lengths - 1) < 0.02).all())


def _only_rises(column: FloatArray) -> bool:
    return bool((column[1:] > column[:-1]).all())
