"""Points as text, one a line: XYZ, PTS, ASC, TXT, CSV."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray
from scanweld.io.raw import RawScan
from scanweld.io.text import parse_numbers, words_per_line
from scanweld.io.text_columns import (
    Columns,
    columns_by_name,
    is_index,
    is_known,
    scan_of_columns,
    without_words,
)
from scanweld.io.text_encoding import plain_text
from scanweld.io.text_head import Head, column_names, split_head, unknown_names, without_comment
from scanweld.io.text_separators import with_spaces
from scanweld.io.text_values import columns_by_values


def read_xyz(path: Path, data: bytes) -> RawScan:
    """Points with x, y, z and whatever else columns with names hold.

    Numbers are separated by white space, commas or semicolons, decimals with a point or, where
    that is certain, with a comma. Comments begin with ``#`` or ``//``. Column names, the number of
    points and a few lines of words may stand above. Without names the first three columns are
    x y z, behind a column that counts if there is one; others are read where they can only be unit
    normals or colours from 0 to 255. Notes tell what was ignored or concluded.

    Raises:
        ReadError: If something is no number, lines or the number of points are wrong, or it is not
            certain what the columns or commas mean.
    """
    head, text = split_head(path, plain_text(path, data))
    if b"#" in text or b"//" in text:
        text = b"\n".join(map(without_comment, text.splitlines()))
    first_line = len(head.lines) + 1
    named = [len(names) for names in head.names()]
    text = without_words(text, next(head.names(), ()))
    text, has_commas = with_spaces(path, text, named, first_line)
    table = _table(path, text, first_line)
    if head.count is not None and head.count != len(table):
        raise ReadError(
            f"{path}: holds {len(table)} points but says {head.count} (truncated, or a wrong "
            "count); copy it again or export it anew"
        )
    raw = scan_of_columns(table, _columns(path, head, table))
    notes = ("decimal commas read as points",) if has_commas else ()
    skipped = [line for line in head.words if not column_names(line)]
    notes += tuple(f"line above the numbers skipped: {line!r}" for line in skipped)
    return replace(raw, notes=notes + raw.notes)


def _table(path: Path, text: bytes, first_line: int) -> FloatArray:
    """All numbers (N, columns)."""
    sizes = words_per_line(text)
    filled = np.flatnonzero(sizes)
    if not len(filled):
        raise ReadError(f"{path}: holds no points; leave it out")
    # Before the widths: prose is better described by its first word than by their number.
    numbers = parse_numbers(path, text, first_line)
    width = int(sizes[filled[0]])
    odd = filled[sizes[filled] != width]
    if len(odd):
        raise ReadError(
            f"{path}: line {odd[0] + first_line}: {sizes[odd[0]]} numbers where the lines before "
            f"have {width}; correct it or export it anew"
        )
    return numbers.reshape(-1, width)


def _columns(path: Path, head: Head, table: FloatArray) -> Columns:
    """What the columns mean, by the names above them or by their values."""
    width = table.shape[1]
    for names in head.names():
        if len(names) == width:
            return columns_by_name(path, names)
        if len(names) == width - 1 and is_index(table[:, 0]):
            return columns_by_name(path, ("", *names))
        if names[:3] != ("x", "y", "z") or (len(names) > 3 and all(map(is_known, names))):
            raise ReadError(
                f"{path}: {len(names)} column names ({' '.join(names)}) above {width} columns; "
                "name each column once, or remove the line"
            )
    line = unknown_names(head, width)
    if line in head.words:
        raise ReadError(
            f"{path}: no x, y and z among its column names {line!r}; call three columns so, or "
            "remove the line"
        )
    columns = columns_by_values(path, table)
    if line is None:
        return columns
    return replace(columns, notes=(f"not understood as column names: {line!r}", *columns.notes))
