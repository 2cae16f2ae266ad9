"""The body of a PLY file, decoded in bulk: ASCII and both binary orders by the same code."""

import sys
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from scanweld.compiled.kernels import njit
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


class _Fault(IntEnum):
    """Instead of where the rows end."""

    TOO_SHORT = -1
    NO_LENGTH = -2


_FLOAT, _SIGNED = ord("f"), ord("i")


class _BodyError(Exception):
    """The body does not fit the header; caught above, where the file is known."""

    def __init__(self, what: str = "the body ends too early (truncated, or a wrong count)") -> None:
        super().__init__(what)


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
    if end <= len(body):
        rows = np.frombuffer(body, row, element.count, start)
        if _all_lengths_are(element, rows, lengths):
            return _uniform_columns(element, rows), end
    if not lengths:
        raise _BodyError
    return _ragged_columns(element, order, body, start)


def _empty(prop: PlyProperty) -> NDArray | Ragged:
    values = np.zeros(0, dtype=prop.type)
    return Ragged(np.zeros(0, dtype=np.int64), values) if prop.is_list else values


def _first_lengths(element: PlyElement, order: str, body: memoryview, start: int) -> list[int]:
    """Lengths of the first row's lists: most files have the same in every row."""
    if not any(p.is_list for p in element.properties):
        return []
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
    codes = [p.count_type or "" for p in element.properties]  # such as u1
    count_sizes = [int(code[1:] or 0) for code in codes]
    kinds = [ord(code[0]) if code else 0 for code in codes]
    least = sum(count or size for count, size in zip(count_sizes, sizes, strict=True))
    if element.count * least > len(body) - start:
        raise _BodyError
    layout = np.array([sizes, count_sizes, kinds])
    octets = np.frombuffer(body, np.uint8)
    begins, lengths, end = _find_lists(octets, start, element.count, layout, order == ">")
    if end == _Fault.TOO_SHORT:
        raise _BodyError
    if end == _Fault.NO_LENGTH:
        raise _BodyError("a list's length is not a whole number from 0 up")
    return begins, lengths, end


def _gather(body: memoryview, begins: IntArray, lengths: IntArray, dtype: np.dtype) -> NDArray:
    """Values of all rows, one after the other, from the offsets where each row's begin."""
    size = dtype.itemsize
    return _octets_of_lists(np.frombuffer(body, np.uint8), begins, size * lengths).view(dtype)


@njit(cache=True, nogil=True)
def _find_lists(
    octets: ByteArray,
    start: int,
    count: int,
    layout: IntArray,
    is_big: bool,
) -> tuple[IntArray, IntArray, int]:  # pragma: no cover - compiled
    """Where values begin, and how many there are, in rows of scalars and lists.

    Args:
        octets: The body.
        start: Where the first row begins.
        count: Number of rows.
        layout: (3, P), of each property: size of a value, size of the length, 0 for a scalar, and
            NumPy's letter for the kind of the length's type.
        is_big: Whether the most significant octet comes first.

    Returns:
        Begins and lengths (count, P), and where the last row ends, or what is wrong.
    """
    sizes, count_sizes, kinds = layout
    begins = np.empty((count, len(sizes)), dtype=np.int64)
    lengths = np.ones((count, len(sizes)), dtype=np.int64)
    at, word = start, np.zeros(8, dtype=np.uint8)
    single, double = word[:4].view(np.float32), word.view(np.float64)
    for row in range(count):
        for k in range(len(sizes)):
            size, kind = count_sizes[k], kinds[k]
            if at + size > len(octets):
                return begins, lengths, _Fault.TOO_SHORT.value
            if size > 0:
                length = 0.0
                for i in range(size):
                    word[i] = octets[at + (size - 1 - i if is_big else i)]
                if kind == _FLOAT:
                    length = np.float64(single[0]) if size == 4 else double[0]
                else:
                    for i in range(size - 1, -1, -1):
                        length = 256.0 * length + word[i]
                    if kind == _SIGNED and word[size - 1] >= 128:
                        length = -1.0
                if not (length >= 0 and length == np.floor(length)):
                    return begins, lengths, _Fault.NO_LENGTH.value
                if length > len(octets):
                    return begins, lengths, _Fault.TOO_SHORT.value
                lengths[row, k] = np.int64(length)
                at += size
            begins[row, k] = at
            at += sizes[k] * lengths[row, k]
            if at > len(octets):
                return begins, lengths, _Fault.TOO_SHORT.value
    return begins, lengths, at


@njit(cache=True, nogil=True)
def _octets_of_lists(
    octets: ByteArray, begins: IntArray, lengths: IntArray
) -> ByteArray:  # pragma: no cover - compiled
    """The octets of lists that begin somewhere (N,) and are so long (N,), one after the other."""
    values = np.empty(lengths.sum(), dtype=np.uint8)
    put = 0
    for row in range(len(begins)):
        for k in range(lengths[row]):
            values[put + k] = octets[begins[row] + k]
        put += lengths[row]
    return values
