"""What the 3D view draws, quantised and packed into text."""

import base64
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanweld.geometry.arrays import FloatArray, IntArray

LARGEST = np.iinfo(np.uint16).max
"""Of a coordinate, after quantising."""
TYPES: Mapping[str, str] = {"uint8": "u1", "int8": "i1", "uint16": "<u2", "int32": "<i4"}
"""Types of the arrays, by numpy's name."""
LEVEL = 4
"""Of deflate: 9 takes ten times as long for 2 % less."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Box:
    """The cube in which coordinates are quantised: its middle, and half its edge."""

    centre: tuple[float, float, float]
    half: float


def box_around(points: Sequence[FloatArray]) -> Box:
    """The cube about all points (N, 3)."""
    low = np.min([part.min(axis=0) for part in points if len(part)], axis=0)
    high = np.max([part.max(axis=0) for part in points if len(part)], axis=0)
    x, y, z = (0.5 * (low + high)).tolist()
    return Box(centre=(x, y, z), half=float(0.5 * (high - low).max()) or 1.0)


def quantised(points: FloatArray, box: Box) -> NDArray[np.uint16]:
    """Points (N, 3) as 16-bit numbers within the box."""
    share = (points - np.array(box.centre)) / (2 * box.half) + 0.5
    return np.rint(LARGEST * np.clip(share, 0, 1)).astype(np.uint16)


def directions(normals: FloatArray) -> NDArray[np.int8]:
    """Unit vectors (N, 3) as (N, 4) signed bytes, the last 0: a multiple of 4 bytes each."""
    padded = np.zeros((len(normals), 4), np.int8)
    padded[:, :3] = np.rint(127 * np.clip(np.nan_to_num(normals), -1, 1))
    return padded


def steps(indices: IntArray) -> NDArray[np.int32]:
    """Indices as differences from the one before, which compress well."""
    flat = indices.ravel().astype(np.int32)
    return np.diff(flat, prepend=np.int32(0)).astype(np.int32)


def packed(arrays: Mapping[str, NDArray]) -> tuple[dict[str, Any], str]:
    """Where each array lies (type, offset, length), and all of them as base64 of deflated bytes."""
    index: dict[str, Any] = {}
    parts: list[bytes] = []
    offset = 0
    for name, array in arrays.items():
        body = np.ascontiguousarray(array).astype(TYPES[array.dtype.name]).tobytes()
        index[name] = {"type": array.dtype.name, "offset": offset, "length": int(array.size)}
        padding = -len(body) % 4  # typed arrays begin at multiples of their size
        parts += [body, bytes(padding)]
        offset += len(body) + padding
    return index, base64.b64encode(zlib.compress(b"".join(parts), LEVEL)).decode("ascii")
