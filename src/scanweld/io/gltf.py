"""The container of a GLB file: its description, the arrays in its buffer, and its nodes' motions.

Specification: Khronos, "glTF 2.0".
"""

import json
import struct
from base64 import b64decode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import LARGEST_EXACT, FloatArray
from scanweld.io.matrices import rotation_of_quaternion

_LOOKS = ("materials", "texture", "lights", "xmp")
"""Words in the names of extensions that change no point."""
_HEAD, _CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")


class Component(IntEnum):
    """Types of numbers in arrays, named by NumPy's codes."""

    i1 = 5120
    u1 = 5121
    i2 = 5122
    u2 = 5123
    u4 = 5125
    f4 = 5126


class Element(IntEnum):
    """What an array holds one after the other, and of how many numbers that is."""

    SCALAR = 1
    VEC2 = 2
    VEC3 = 3
    VEC4 = 4


class Target(IntEnum):
    """What the bytes of a buffer are for."""

    VERTICES = 34962
    INDICES = 34963


class Mode(IntEnum):
    """What the vertices of a primitive make, of what is read."""

    POINTS = 0
    TRIANGLES = 4


@dataclass(frozen=True, slots=True)
class Gltf:
    """A GLB file.

    Attributes:
        path: For messages.
        content: The description.
        chunk: The binary chunk, which is the first buffer where that is not written as text.
    """

    path: Path
    content: dict[str, Any]
    chunk: memoryview

    def broken(self, what: str) -> ReadError:
        """What is said of a file that cannot be read."""
        return ReadError(f"{self.path}: {what}; export it anew, or as PLY")

    def entries(self, holder: Any, key: str) -> list[dict[str, Any]]:
        """A list of objects in an object; empty if it is not there.

        Raises:
            ReadError: If it is something else.
        """
        found = holder.get(key, []) if isinstance(holder, dict) else None
        if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
            raise self.broken(f"its {key} are no list")
        return found

    def accessor(self, index: Any, widths: Sequence[int]) -> NDArray:
        """An array (N, k) of numbers in the buffer, where k is one of the widths.

        Raises:
            ReadError: If it is broken or packed.
        """
        told = self._entry("accessors", index)
        code = told.get("componentType")
        kind = Component(code).name if code in [*Component] else None
        width = Element.__members__.get(_hashable(told.get("type")), 0)
        count = self._number(told, "count")
        if kind is None or width not in widths or "sparse" in told or "bufferView" not in told:
            raise self.broken("holds arrays that are sparse, packed or of a wrong type")
        view = self._entry("bufferViews", told["bufferView"])
        buffer = self._buffer(self._number(view, "buffer"))
        begin = self._number(view, "byteOffset")
        end = begin + self._number(view, "byteLength")
        begin += self._number(told, "byteOffset")
        size = int(kind[1:]) * width
        stride = self._number(view, "byteStride") or size
        if end > len(buffer) or (count and begin + (count - 1) * stride + size > end):
            raise self.broken("its buffer is smaller than it says (truncated?)")
        if stride < size or not count:
            raise self.broken("holds an empty array")
        octets = np.frombuffer(buffer, np.uint8)[begin:end]
        table = np.lib.stride_tricks.as_strided(octets, (count, size), (stride, 1), writeable=False)
        return np.ascontiguousarray(table).view("<" + kind)

    def _buffer(self, index: int) -> bytes | memoryview:
        uri = self._entry("buffers", index).get("uri")
        if uri is None and index == 0:
            return self.chunk
        head, _, text = str(uri).partition(",")
        if not head.startswith("data:") or not head.endswith(";base64"):
            raise self.broken("has buffers in other files")
        try:
            return b64decode(text, validate=True)
        except ValueError as error:
            raise self.broken("a buffer in its description is broken") from error

    def placed_meshes(self) -> Iterator[tuple[dict[str, Any], FloatArray]]:
        """The meshes of the scene, each with scene_from_mesh (4, 4).

        Raises:
            ReadError: If the nodes are no tree.
        """
        nodes = self.entries(self.content, "nodes")
        if not nodes:
            yield from ((mesh, np.eye(4)) for mesh in self.entries(self.content, "meshes"))
        seen = set[int]()
        todo = [(index, np.eye(4)) for index in self._roots(len(nodes))]
        while todo:
            index, parent = todo.pop()
            node = self._entry("nodes", index)
            if index in seen:
                raise self.broken("its nodes are no tree")
            seen.add(index)
            moved = parent @ self._motion(node)
            if "mesh" in node:
                yield self._entry("meshes", node["mesh"]), moved
            children = node.get("children", [])
            if not isinstance(children, list):
                raise self.broken("its children are no list")
            todo += [(child, moved) for child in reversed(children)]

    def _roots(self, num_nodes: int) -> list[Any]:
        """Roots of the scene; of a file without scenes, of all its nodes."""
        if self.entries(self.content, "scenes"):
            roots = self._entry("scenes", self.content.get("scene", 0)).get("nodes", [])
            if not isinstance(roots, list):
                raise self.broken("its scene is no list of nodes")
            return roots[::-1]
        nodes = self.entries(self.content, "nodes")
        lists = [node.get("children", []) for node in nodes]
        inner = {_hashable(c) for children in lists if isinstance(children, list) for c in children}
        return [k for k in reversed(range(num_nodes)) if k not in inner]

    def _motion(self, node: dict[str, Any]) -> FloatArray:
        """parent_from_node (4, 4)."""
        motion = np.eye(4)
        if "matrix" in node:
            return self._vector(node["matrix"], 16).reshape(4, 4).T
        turn = rotation_of_quaternion(self._vector(node.get("rotation", [0, 0, 0, 1]), 4))
        motion[:3, :3] = turn * self._vector(node.get("scale", [1, 1, 1]), 3)
        motion[:3, 3] = self._vector(node.get("translation", [0, 0, 0]), 3)
        return motion

    def _vector(self, values: Any, count: int) -> FloatArray:
        is_vector = isinstance(values, list) and len(values) == count
        if not is_vector or not all(type(each) in (int, float) for each in values):
            raise self.broken("a node's motion is not made of numbers")
        try:
            vector = np.array([float(each) for each in values])
        except OverflowError:
            vector = np.array([np.inf])
        if not (np.abs(vector) < LARGEST_EXACT).all():
            raise self.broken("a node's motion is too large")
        return vector

    def _entry(self, key: str, index: Any) -> dict[str, Any]:
        entries = self.entries(self.content, key)
        if type(index) is not int or not 0 <= index < len(entries):
            raise self.broken(f"names {key} that are not there")
        return entries[index]

    def _number(self, holder: dict[str, Any], key: str) -> int:
        value = holder.get(key, 0)
        if type(value) is not int or not 0 <= value < 2**40:
            raise self.broken(f"its {key} is {str(value)[:20]}")
        return value


def parse_glb(path: Path, data: bytes) -> Gltf:
    """The chunks of a GLB file.

    Raises:
        ReadError: If it is no such file, truncated, or needs an extension that packs arrays.
    """
    if len(data) < _HEAD.size or data[:4] != b"glTF" or _HEAD.unpack_from(data)[1] != 2:
        raise ReadError(f"{path}: not a GLB file of version 2; export it anew, or as PLY")
    chunks: dict[bytes, memoryview] = {}
    at = _HEAD.size
    while at + _CHUNK.size <= len(data):
        length, kind = _CHUNK.unpack_from(data, at)
        at += _CHUNK.size
        if at + length > len(data):
            raise ReadError(f"{path}: ends too early (truncated); copy it again")
        chunks.setdefault(kind, memoryview(data)[at : at + length])
        at += length
    try:
        content = json.loads(bytes(chunks.get(b"JSON", b"")))
    except (ValueError, RecursionError) as error:
        raise ReadError(f"{path}: its description cannot be read; export it anew") from error
    gltf = Gltf(path, content, chunks.get(b"BIN\0", memoryview(b"")))
    if not isinstance(content, dict):
        raise gltf.broken("its description is no object")
    required = content.get("extensionsRequired", [])
    if not isinstance(required, list):
        raise gltf.broken("its extensionsRequired are no list")
    needed = [str(name) for name in required if not any(word in str(name) for word in _LOOKS)]
    if needed:
        raise gltf.broken(f"needs {', '.join(needed)[:80]}, which is not read")
    return gltf


def _hashable(value: Any) -> Any:
    return value if isinstance(value, int | str) else None
