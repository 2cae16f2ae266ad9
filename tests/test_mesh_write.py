"""Meshes as OBJ, STL and GLB: read back by ourselves and by trimesh."""

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh.visual import ColorVisuals

from scanweld.errors import WriteError
from scanweld.geometry.mesh import TriangleMesh, vertex_normals
from scanweld.io import read_mesh
from scanweld.io.mesh_write import glb_bytes, obj_bytes, stl_bytes
from tests.scenes import PRIMITIVES


def colored_box() -> TriangleMesh:
    """A box somewhere in space, with normals and colours."""
    box = PRIMITIVES["box"]()
    vertices = box.vertices + np.array([1.0, -2.0, 1000.0 / 3.0])
    colors = np.random.default_rng(0).integers(0, 256, size=vertices.shape, dtype=np.uint8)
    normals = vertex_normals(vertices, box.faces)
    return TriangleMesh(vertices=vertices, faces=box.faces, normals=normals, colors=colors)


def loaded(data: bytes, kind: str) -> trimesh.Trimesh:
    # Beside a material trimesh forgets the colours of vertices, so it is told to pass over that.
    options: dict[str, Any] = {"skip_materials": True} if kind == "glb" else {}
    found = trimesh.load(io.BytesIO(data), file_type=kind, process=False, force="mesh", **options)
    assert isinstance(found, trimesh.Trimesh)
    return found


def gltf(data: bytes) -> tuple[dict, bytes]:
    """The description and the buffer of a GLB, by its specification (section 4.4)."""
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON" and size % 4 == 0
    rest = data[20 + size :]
    body_size, kind = struct.unpack("<I4s", rest[:8])
    assert kind == b"BIN\0" and body_size % 4 == 0 and len(rest) == 8 + body_size
    return json.loads(data[20 : 20 + size]), rest[8:]


def test_obj_keeps_everything_to_the_last_bit(tmp_path: Path):
    mesh = colored_box()
    (tmp_path / "box.obj").write_bytes(obj_bytes(mesh))
    again = read_mesh(tmp_path / "box.obj")
    assert np.array_equal(again.vertices, mesh.vertices)
    assert np.array_equal(again.faces, mesh.faces)
    assert again.colors is not None and mesh.colors is not None
    assert np.array_equal(again.colors, mesh.colors)
    other = trimesh.load(tmp_path / "box.obj", process=False, maintain_order=True)
    assert isinstance(other, trimesh.Trimesh)
    assert np.array_equal(other.vertices[other.faces], mesh.vertices[mesh.faces])
    assert mesh.normals is not None
    assert np.allclose(other.vertex_normals[other.faces], mesh.normals[mesh.faces], atol=1e-6)


def test_stl_keeps_the_triangles_in_single_precision(tmp_path: Path):
    mesh = colored_box()
    data = stl_bytes(mesh)
    (tmp_path / "box.stl").write_bytes(data)
    corners = mesh.vertices[mesh.faces].astype(np.float32)
    again = read_mesh(tmp_path / "box.stl")
    assert np.array_equal(again.vertices[again.faces], corners)
    assert np.array_equal(loaded(data, "stl").triangles, corners)
    assert not data.startswith(b"solid")  # which would mean ASCII


def test_the_same_mesh_gives_the_same_bytes_and_one_without_faces_none():
    for write in (obj_bytes, stl_bytes, glb_bytes):
        assert write(colored_box()) == write(colored_box())
    empty = TriangleMesh(vertices=np.eye(3), faces=np.zeros((0, 3), np.int64))
    for write in (stl_bytes, glb_bytes):
        with pytest.raises(WriteError, match="no faces"):
            write(empty)


@pytest.mark.parametrize(
    ("unit", "metres"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254), (None, 1.0)]
)
def test_glb_is_in_metres(unit: str | None, metres: float):
    mesh = colored_box()
    found = loaded(glb_bytes(mesh, unit), "glb")
    assert np.allclose(found.vertices, metres * mesh.vertices, rtol=1e-6)
    assert np.array_equal(found.faces, mesh.faces)
    # Colours are floats there, which trimesh rounds.
    assert isinstance(found.visual, ColorVisuals)
    assert np.abs(found.visual.vertex_colors[:, :3] - 255.0 * linear(mesh)).max() <= 1.0


def linear(mesh: TriangleMesh) -> np.ndarray:
    """The colours in linear light (IEC 61966-2-1)."""
    assert mesh.colors is not None
    srgb = mesh.colors / 255.0
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_glb_has_y_up_and_is_not_mirrored(up: str):
    mesh = colored_box()
    found = loaded(glb_bytes(mesh, "m", up), "glb")
    sign = -1.0 if up.startswith("-") else 1.0
    height = sign * mesh.vertices[:, "xyz".index(up[-1])]
    assert np.allclose(found.vertices[:, 1], height, rtol=1e-6)
    volumes = [trimesh.Trimesh(m.vertices, m.faces, process=False).volume for m in (found, mesh)]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-4)


def test_glb_is_what_its_specification_asks():
    mesh = colored_box()
    content, body = gltf(glb_bytes(mesh))
    assert content["asset"]["version"] == "2.0"
    (primitive,) = content["meshes"][0]["primitives"]
    assert content["buffers"] == [{"byteLength": len(body)}]
    arrays = {}
    for name, index in {**primitive["attributes"], "faces": primitive["indices"]}.items():
        accessor = content["accessors"][index]
        view = content["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        part = body[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        dtype = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        arrays[name] = np.frombuffer(part, dtype).reshape(accessor["count"], -1)
    position = content["accessors"][primitive["attributes"]["POSITION"]]
    assert position["min"] == arrays["POSITION"].min(axis=0).tolist()
    assert position["max"] == arrays["POSITION"].max(axis=0).tolist()
    assert mesh.normals is not None and np.allclose(arrays["NORMAL"], mesh.normals, atol=1e-6)
    assert arrays["faces"].max() == len(mesh.vertices) - 1
    # Linear light: a mid grey of 188 is half as bright as white, not three quarters.
    grey = TriangleMesh(
        vertices=np.eye(3),
        faces=np.array([[0, 1, 2]]),
        colors=np.array([[0] * 3, [188] * 3, [255] * 3], dtype=np.uint8),
    )
    color = np.frombuffer(gltf(glb_bytes(grey))[1], "<f4", count=9, offset=36)
    assert color == pytest.approx([0] * 3 + [0.5029] * 3 + [1] * 3, abs=1e-3)
    mesh = TriangleMesh(vertices=np.eye(3), faces=np.array([[0, 1, 2]]), normals=np.zeros((3, 3)))
    normals = np.frombuffer(gltf(glb_bytes(mesh))[1], "<f4", count=9, offset=36).reshape(3, 3)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
