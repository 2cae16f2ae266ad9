"""Writing meshes as OBJ, STL and GLB; PLY is in ``ply_write``."""

import json
import struct

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import WriteError
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.mesh import TriangleMesh, face_normals
from scanweld.io.gltf import Component, Mode, Target
from scanweld.io.local_origin import find_shift, shift_text
from scanweld.io.scan_formats.stl import FACET, HEAD

_TURNS = {
    "x": [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    "y": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    "z": [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
}
"""Rotations that bring an axis to +Y; for those that point down, half a turn about Z follows."""
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}


def obj_bytes(mesh: TriangleMesh) -> bytes:
    """An OBJ with the mesh's normals, and colours (0 to 1) behind the coordinates.

    Colours there are no part of the format, but what most programs write and read. A mesh far off
    is written about a local origin, which a comment tells.
    """
    vertices, head = mesh.vertices, []
    if (shift := find_shift(vertices)) is not None:
        vertices, head = vertices - shift, [f"# {shift_text(shift)}"]
    if mesh.colors is not None:
        vertices = np.hstack([vertices, np.round(mesh.colors / 255.0, 6)])
    lines = head + ["v " + " ".join(map(repr, row)) for row in (vertices + 0.0).tolist()]
    corner = "{0}"
    if mesh.normals is not None:
        normals = np.round(mesh.normals, 7) + 0.0
        lines += ["vn " + " ".join(map(repr, row)) for row in normals.tolist()]
        corner = "{0}//{0}"
    lines += ["f " + " ".join(corner.format(k) for k in row) for row in (mesh.faces + 1).tolist()]
    return ("\n".join(lines) + "\n").encode("ascii")


def stl_bytes(mesh: TriangleMesh) -> bytes:
    """A binary STL: single precision, neither shared vertices nor colours.

    A mesh far off is written about a local origin, which the header tells.

    Raises:
        WriteError: If the mesh has no faces, which is all that an STL holds.
    """
    _require_faces(mesh, "STL")
    facets = np.zeros(len(mesh.faces), dtype=FACET)
    normals = face_normals(mesh.vertices, mesh.faces)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    facets["normal"] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    shift = find_shift(mesh.vertices)
    corners = mesh.vertices[mesh.faces]
    facets["corners"] = corners if shift is None else corners - shift
    about = "coordinates in the unit of the scans" if shift is None else shift_text(shift)
    head = f"binary STL, {about}".encode("ascii").ljust(80)
    return HEAD.pack(head, len(facets)) + facets.tobytes()


def glb_bytes(mesh: TriangleMesh, unit: str | None = None, up: str = "y") -> bytes:
    """A binary glTF 2.0: Y up, in metres, colours linear, as its specification asks.

    A mesh far off is written about a local origin, to where its node is moved.

    Args:
        mesh: With at least one face.
        unit: Of its coordinates; taken for metres if None.
        up: Its axis that points up: x, y, z, -x, -y or -z.

    Raises:
        WriteError: If the mesh has no faces.
        KeyError: If the unit or the axis is unknown.
    """
    _require_faces(mesh, "GLB")
    turn = _gltf_from_mesh(up)
    scale = 1.0 if unit is None else METRES[unit]
    shift = find_shift(mesh.vertices)
    local = mesh.vertices if shift is None else mesh.vertices - shift
    buffer = _Buffer()
    attributes = {"POSITION": buffer.add(scale * local @ turn.T, with_bounds=True)}
    if mesh.normals is not None:
        attributes["NORMAL"] = buffer.add(_unit(mesh.normals) @ turn.T)
    if mesh.colors is not None:
        attributes["COLOR_0"] = buffer.add(_linear(mesh.colors))
    faces = buffer.add_indices(mesh.faces)
    primitive = {"attributes": attributes, "indices": faces, "material": 0, "mode": Mode.TRIANGLES}
    node: dict[str, object] = {"mesh": 0, "name": "model"}
    if shift is not None:
        node["translation"] = (scale * turn @ shift + 0.0).tolist()
    return buffer.glb(primitive, node)


def _require_faces(mesh: TriangleMesh, title: str) -> None:
    if not len(mesh.faces):
        raise WriteError(f"the mesh has no faces, so there is nothing to write as {title}")


def _gltf_from_mesh(up: str) -> FloatArray:
    """The rotation (3, 3) that brings an axis of the mesh to +Y.

    Raises:
        KeyError: If there is no such axis.
    """
    turn = np.array(_TURNS[up.removeprefix("-")])
    return np.diag([-1.0, -1.0, 1.0]) @ turn if up.startswith("-") else turn


def _unit(normals: FloatArray) -> FloatArray:
    """The normals at unit length; those of no length, which glTF does not allow, along z."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    fallback = np.tile([0.0, 0.0, 1.0], (len(normals), 1))
    return np.divide(normals, length, out=fallback, where=length > 0)


def _linear(colors: ByteArray) -> FloatArray:
    """Colours (V, 3) as photographs have them (sRGB) in linear light, 0 to 1."""
    srgb = colors / 255.0
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


class _Buffer:
    """The one buffer of a glTF, all of whose arrays have elements of four bytes."""

    def __init__(self) -> None:
        self._bodies: list[bytes] = []
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, object]] = []

    def add(self, vectors: FloatArray, *, with_bounds: bool = False) -> int:
        """Add vectors (N, 3), and say by which number they are known."""
        values = vectors.astype("<f4")
        bounds: dict[str, object] = {}
        if with_bounds:
            bounds = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self._add(values, len(values), "VEC3", Component.f4, Target.VERTICES, bounds)

    def add_indices(self, faces: NDArray) -> int:
        """Add faces (F, 3), likewise."""
        return self._add(
            faces.astype("<u4"), faces.size, "SCALAR", Component.u4, Target.INDICES, {}
        )

    def _add(
        self,
        values: NDArray,
        count: int,
        kind: str,
        component: int,
        target: int,
        bounds: dict[str, object],
    ) -> int:
        body = values.tobytes()
        offset = sum(map(len, self._bodies))
        self._bodies.append(body)
        self._views.append(
            {"buffer": 0, "byteOffset": offset, "byteLength": len(body), "target": target}
        )
        accessor = {"componentType": component, "count": count, "type": kind}
        self._accessors.append({"bufferView": len(self._views) - 1, **accessor, **bounds})
        return len(self._accessors) - 1

    def glb(self, primitive: dict[str, object], node: dict[str, object]) -> bytes:
        """The file: a header, the description as JSON, the buffer."""
        body = b"".join(self._bodies)
        matte = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
        content = {
            "asset": {"version": "2.0", "generator": "scanweld"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [node],
            "meshes": [{"primitives": [primitive]}],
            "materials": [{"pbrMetallicRoughness": matte, "doubleSided": True}],
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(body)}],
        }
        text = json.dumps(content, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
