"""The body of a PLY file, decoded in bulk: ASCII and both binary orders by the same code."""

import struct
import sys
from array import array
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, IntArray
from scanweld.io.ply_header import PlyElement, PlyHeader, PlyProperty
from scanweld.io.text import parse_numbers


@dataclass(frozen=True, slots=True)
class Ragged:
    """A list property: lengths (N,) of the rows' lists and all values (sum of lengths,)."""

    counts: IntArray | ByteArray
    values: NDArray


Columns = dict[str, NDArray | Ragged]


def decode_body(header: PlyHeader, data: bytes) -> dict[str, Columns]:
    """The columns of every element, by the names of element and property.

    An ASCII body is first turned into a binary one whose types are all ``double``.

    Raises:
        ReadError: If the body is shorter or longer than the header says, or not made of numbers.
    """
    body = memoryview(data)[header.body_start :]
    elements = header.elements
    order = ">" if header.format == "binary_big_endian" else "<"
    if header.format == "ascii":
        first_line = 1 + data.count(b"\n", 0, header.body_start)
        body = parse_numbers(header.path, bytes(body), first_line).data.cast("B")
        order = "<" if sys.byteorder == "little" else ">"
        elements = tuple(_as_doubles(element) for element in elements)
    tables: dict[str, Columns] = {}
    offset = 0
    for element in elements:
        try:
            tables[element.name], offset = _decode_element(element, order, body, offset)
        except _BodyError as error:
            raise ReadError(
                f"{header.path}: {error}, in element '{element.name}' of {element.count} rows; "
                "copy the file again or export it anew"
            ) from error
    if bytes(body[offset:]).strip(b"\r\n\t \0"):
        raise ReadError(
            f"{header.path}: the body holds more than its header says, so the counts are wrong; "
            "export the file anew"
        )
    return tables


class _BodyError(Exception):
    """The body does not fit the header; caught above, where the file is known."""


_TRUNCATED = "the body ends too early (truncated, or a wrong count)"


def _as_doubles(element: PlyElement) -> PlyElement:
    return replace(
        element,
        properties=tuple(
            replace(p, type="f8", count_type="f8" if p.is_list else None)
            for p in element.properties
        ),
    )


def _decode_element(
    element: PlyElement, order: str, body: memoryview, start: int
) -> tuple[Columns, int]:
    """The element's columns and where the next element starts."""
    if element.count == 0 or not element.properties:
        return {p.name: _empty(p) for p in element.properties}, start
    lengths = _first_lengths(element, order, body, start)
    row = _row_type(element, order, lengths)
    end = start + row.itemsize * element.count
    has_lists = bool(lengths)
    if end <= len(body):
        rows = np.frombuffer(body, row, element.count, start)
        if _all_lengths_are(element, rows, lengths):
            return _uniform_columns(element, rows), end
    if not has_lists:
        raise _BodyError(_TRUNCATED)
    if [prop.count_type for prop in element.properties] == ["u1"]:
        return _short_columns(element, order, body, start)
    return _ragged_columns(element, order, body, start)


def _empty(prop: PlyProperty) -> NDArray | Ragged:
    values = np.zeros(0, dtype=prop.type)
    return Ragged(np.zeros(0, dtype=np.int64), values) if prop.is_list else values


def _first_lengths(element: PlyElement, order: str, body: memoryview, start: int) -> list[int]:
    """Lengths of the first row's lists: most files have the same in every row."""
    _, lengths, _ = _walk(replace(element, count=1), order, body, start)
    return [n for n, p in zip(lengths[0].tolist(), element.properties, strict=True) if p.is_list]


def _row_type(element: PlyElement, order: str, lengths: list[int]) -> np.dtype:
    """The structured type of a row; property k is field ``vk``, its length, if a list, ``nk``."""
    fields: list[tuple] = []
    rest = iter(lengths)
    for k, prop in enumerate(element.properties):
        if prop.count_type is None:
            fields.append((f"v{k}", order + prop.type))
        else:
            fields.append((f"n{k}", order + prop.count_type))
            fields.append((f"v{k}", order + prop.type, (next(rest),)))
    return np.dtype(fields)


def _all_lengths_are(element: PlyElement, rows: NDArray, lengths: list[int]) -> bool:
    lists = [k for k, prop in enumerate(element.properties) if prop.is_list]
    return all(bool((rows[f"n{k}"] == n).all()) for k, n in zip(lists, lengths, strict=True))


def _uniform_columns(element: PlyElement, rows: NDArray) -> Columns:
    columns: Columns = {}
    for k, prop in enumerate(element.properties):
        values = rows[f"v{k}"]
        if prop.is_list:
            counts = np.full(len(rows), values.shape[1], dtype=np.int64)
            columns[prop.name] = Ragged(counts, values.reshape(-1))
        else:
            columns[prop.name] = values
    return columns


def _ragged_columns(
    element: PlyElement, order: str, body: memoryview, start: int
) -> tuple[Columns, int]:
    """Rows of differing lengths: one pass finds where everything lies, then bulk copies."""
    begins, lengths, end = _walk(element, order, body, start)
    columns: Columns = {}
    for k, prop in enumerate(element.properties):
        values = _gather(body, begins[:, k], lengths[:, k], np.dtype(order + prop.type))
        columns[prop.name] = Ragged(lengths[:, k], values) if prop.is_list else values
    return columns, end


def _walk(
    element: PlyElement, order: str, body: memoryview, start: int
) -> tuple[IntArray, IntArray, int]:
    """Byte offsets and lengths (rows, properties) of all values, and the element's end."""
    sizes = [np.dtype(p.type).itemsize for p in element.properties]
    readers = [
        struct.Struct(order + np.dtype(p.count_type).char) if p.count_type else None
        for p in element.properties
    ]
    steps = list(zip(sizes, readers, strict=True))
    begins, lengths = array("q"), array("d")
    at = start
    try:
        for _ in range(element.count):
            for size, reader in steps:
                length = 1
                if reader is not None:
                    (length,) = reader.unpack_from(body, at)
                    at += reader.size
                begins.append(at)
                lengths.append(length)
                at += size * int(length)
    except (struct.error, ValueError, OverflowError) as error:
        raise _BodyError(_TRUNCATED) from error
    if not start <= at <= len(body):
        raise _BodyError(_TRUNCATED)
    told = np.frombuffer(lengths, np.float64)
    counts = told.astype(np.int64)
    if (counts != told).any() or counts.min() < 0:
        raise _BodyError("a list's length is not a whole number from 0 up")
    shape = (element.count, len(steps))
    return np.frombuffer(begins, np.int64).reshape(shape), counts.reshape(shape), at


def _short_columns(
    element: PlyElement, order: str, body: memoryview, start: int
) -> tuple[Columns, int]:
    """Rows of one list each, whose length is a byte: faces and range grids, often millions."""
    (prop,) = element.properties
    dtype = np.dtype(order + prop.type)
    octets = np.frombuffer(body, np.uint8)
    lengths, end = _short_lengths(octets, start, element.count, dtype.itemsize)
    if end > len(body):
        raise _BodyError(_TRUNCATED)
    values = _short_values(octets, start, lengths, dtype.itemsize).view(dtype)
    return {prop.name: Ragged(lengths, values)}, end


@njit(cache=True, nogil=True)
def _short_lengths(
    octets: ByteArray, start: int, count: int, size: int
) -> tuple[ByteArray, int]:  # pragma: no cover - compiled
    """Lengths (count,) of lists of values of a size, and where they end; past the end if cut."""
    lengths = np.zeros(count, dtype=np.uint8)
    at = start
    for row in range(count):
        if at >= len(octets):
            return lengths, len(octets) + 1
        lengths[row] = octets[at]
        at += 1 + size * int(octets[at])
    return lengths, at


@njit(cache=True, nogil=True)
def _short_values(
    octets: ByteArray, start: int, lengths: ByteArray, size: int
) -> ByteArray:  # pragma: no cover - compiled
    """The octets of all values of such lists, one after the other."""
    total = 0
    for length in lengths:
        total += size * int(length)
    values = np.empty(total, dtype=np.uint8)
    at, put = start, 0
    for length in lengths:
        step = size * int(length)
        values[put : put + step] = octets[at + 1 : at + 1 + step]
        at += 1 + step
        put += step
    return values


def _gather(body: memoryview, begins: IntArray, lengths: IntArray, dtype: np.dtype) -> NDArray:
    """Values of all rows, one after the other, from the offsets where each row's begin."""
    before = np.cumsum(lengths) - lengths
    within = np.arange(int(lengths.sum())) - np.repeat(before, lengths)
    offsets = np.repeat(begins, lengths) + dtype.itemsize * within
    octets = np.frombuffer(body, np.uint8)[offsets[:, None] + np.arange(dtype.itemsize)]
    return octets.reshape(-1).view(dtype)
