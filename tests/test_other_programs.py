"""Files that other programs write are read as they meant them, and they read ours as we do."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
import trimesh.visual

from scanweld.evaluation.primitives import box
from scanweld.geometry.arrays import ByteArray, FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.scan import RangeScan
from scanweld.io import read_mesh, read_scan, write_mesh_ply, write_scan_ply
from scanweld.io.mesh_write import glb_bytes, obj_bytes, stl_bytes
from tests.libraries import open3d

RNG = np.random.default_rng(4)
POINTS = RNG.random((50, 3))
NORMALS = np.tile([0.6, 0, 0.8], (50, 1))
COLORS = RNG.integers(0, 256, (50, 3)).astype(np.uint8)
FACES = np.concatenate([np.arange(48).reshape(16, 3), RNG.permutation(48).reshape(16, 3)])


def assert_is_cloud(scan: RangeScan, *, has_normals: bool, has_colors: bool) -> None:
    np.testing.assert_allclose(scan.points, POINTS, rtol=0, atol=1e-6)
    assert (scan.normals is not None, scan.colors is not None) == (has_normals, has_colors)
    if scan.normals is not None:
        np.testing.assert_allclose(scan.normals, NORMALS, atol=1e-6)
    if scan.colors is not None:
        np.testing.assert_array_equal(scan.colors, COLORS)


@pytest.mark.parametrize("name", ["a.pcd", "a.ply", "a.xyz", "a.pts", "a.xyzn"])
def test_clouds_of_open3d(name: str, tmp_path: Path):
    o3d = open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    cloud.colors = o3d.utility.Vector3dVector(COLORS / 255)
    cloud.normals = o3d.utility.Vector3dVector(NORMALS)
    path = tmp_path / name
    for options in ({}, {"write_ascii": True}, {"compressed": True}):
        assert o3d.io.write_point_cloud(str(path), cloud, **options)
        read_as = path.rename(tmp_path / "a.xyz") if name.startswith("a.xyz") else path
        scan = read_scan(read_as)
        assert_is_cloud(
            scan,
            has_normals=name in ("a.pcd", "a.ply", "a.xyzn"),
            has_colors=name in ("a.pcd", "a.ply", "a.pts"),
        )


@pytest.mark.parametrize("suffix", ["obj", "off", "stl", "ply", "glb"])
def test_meshes_of_open3d_and_ours_there(suffix: str, tmp_path: Path):
    o3d = open3d()
    solid = o3d.geometry.TriangleMesh.create_sphere(2.0, resolution=8)
    solid.compute_vertex_normals()
    solid.paint_uniform_color([0.2, 0.4, 0.6])
    path = tmp_path / f"a.{suffix}"
    assert o3d.io.write_triangle_mesh(str(path), solid)
    ours = read_mesh(path)
    corners = np.asarray(solid.vertices)[np.asarray(solid.triangles)]
    np.testing.assert_allclose(ours.vertices[ours.faces], corners, atol=1e-5)
    if suffix in ("off", "ply"):  # its colours in GLB are not in linear light, as they should
        np.testing.assert_array_equal(ours.colors, [[51, 102, 153]] * len(ours.vertices))
    if suffix == "off":
        return
    path.write_bytes(written(box(1.0, 2.0, 3.0), suffix, tmp_path))
    theirs = o3d.io.read_triangle_mesh(str(path))
    theirs.merge_close_vertices(1e-9)
    assert len(theirs.triangles) == 12
    assert theirs.get_volume() == pytest.approx(6.0, rel=1e-6)


def written(mesh: TriangleMesh, suffix: str, folder: Path) -> bytes:
    """Our own file of a mesh."""
    writers: dict[str, Callable[[TriangleMesh], bytes]] = {
        "obj": obj_bytes,
        "stl": stl_bytes,
        "glb": glb_bytes,
    }
    if suffix in writers:
        return writers[suffix](mesh)
    write_mesh_ply(folder / "ours.ply", mesh)
    return (folder / "ours.ply").read_bytes()


@pytest.mark.parametrize("suffix", ["obj", "off", "stl", "ply"])
def test_meshes_of_trimesh(suffix: str, tmp_path: Path):
    path = tmp_path / f"ball.{suffix}"
    ball = trimesh.creation.icosphere(subdivisions=2, radius=3.0)
    ball.export(path)
    mesh = read_mesh(path)
    assert len(mesh.vertices) == len(ball.vertices)
    np.testing.assert_allclose(mesh.vertices[mesh.faces], ball.triangles, atol=1e-6)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_of_trimesh_and_ours_there(encoding: str, tmp_path: Path):
    mesh = trimesh.Trimesh(POINTS, FACES, vertex_colors=COLORS, process=False)
    path = tmp_path / "a.ply"
    mesh.export(path, encoding=encoding)
    ours = read_mesh(path)
    np.testing.assert_allclose(ours.vertices, POINTS, atol=1e-6)
    np.testing.assert_array_equal(ours.faces, FACES)
    np.testing.assert_array_equal(ours.colors, COLORS)
    write_scan_ply(path, RangeScan(name="a", points=POINTS, faces=FACES, colors=COLORS))
    theirs = trimesh.load(path, process=False)
    assert isinstance(theirs, trimesh.Trimesh)
    np.testing.assert_array_equal(theirs.vertices, POINTS)
    np.testing.assert_array_equal(theirs.faces, FACES)
    assert isinstance(theirs.visual, trimesh.visual.ColorVisuals)
    np.testing.assert_array_equal(theirs.visual.vertex_colors[:, :3], COLORS)


def test_glb_of_trimesh(tmp_path: Path):
    path = tmp_path / "a.glb"
    ball = trimesh.creation.icosphere(subdivisions=1)
    shades = RNG.integers(0, 256, (len(ball.vertices), 4)).astype(np.uint8)
    ball.visual = trimesh.visual.ColorVisuals(ball, vertex_colors=shades)
    turn = trimesh.transformations.rotation_matrix(1, [1, 2, 3])
    scene = trimesh.Scene()
    scene.add_geometry(ball, transform=turn)
    scene.add_geometry(trimesh.PointCloud(POINTS), transform=turn.T)
    scene.export(path)
    scan = read_scan(path)
    balls, clouds = (
        trimesh.transform_points(p, t) for p, t in ((ball.vertices, turn), (POINTS, turn.T))
    )
    np.testing.assert_allclose(np.sort(scan.points, 0), np.sort([*balls, *clouds], 0), atol=1e-6)
    assert "colours on some of its meshes only" in scan.notes[0]
    ball.export(path)
    np.testing.assert_array_equal(read_scan(path).colors, shades[:, :3])


@pytest.mark.parametrize("is_binary", [True, False])
@pytest.mark.parametrize("form", ["vtk42", "vtk51", "ply", "stl", "obj", "off"])
def test_meshes_of_meshio_and_ours_there(form: str, is_binary: bool, tmp_path: Path):
    meshio = pytest.importorskip("meshio")
    path = tmp_path / f"a.{form[:3]}"
    data = {"a": RNG.random(50), "v": RNG.random((50, 3))} if form.startswith("vtk") else {}
    mesh = meshio.Mesh(POINTS, [("triangle", FACES)], point_data=data)
    options = {} if form in ("obj", "off") else {"binary": is_binary}
    meshio.write(path, mesh, file_format=form, **options)
    ours = read_mesh(path)
    np.testing.assert_allclose(ours.vertices[ours.faces], POINTS[FACES], atol=1e-6)
    if form in ("ply", "stl", "obj"):
        path.write_bytes(written(TriangleMesh(vertices=POINTS, faces=FACES), form, tmp_path))
        theirs = meshio.read(path)
        corners = theirs.points[theirs.cells_dict["triangle"]]
        np.testing.assert_allclose(corners, POINTS[FACES], atol=1e-6)


def test_points_of_laspy_in_every_point_format(tmp_path: Path):
    laspy = pytest.importorskip("laspy")
    for kind in range(11):
        header = laspy.LasHeader(point_format=kind, version="1.4" if kind > 3 else "1.2")
        header.scales, header.offsets = np.full(3, 1e-6), np.array([4e3, 5e3, 0])
        found, stream = laspy.LasData(header), io.BytesIO()
        found.xyz = POINTS + header.offsets
        has_colors = "red" in found.point_format.dimension_names
        for name, channel in zip(("red", "green", "blue"), COLORS.T, strict=True):
            if has_colors:
                setattr(found, name, channel.astype(np.uint16) * 257)
        found.write(stream)
        (tmp_path / "a.las").write_bytes(stream.getvalue())
        scan = read_scan(tmp_path / "a.las")
        np.testing.assert_allclose(scan.points, found.xyz, rtol=0, atol=1e-9)
        assert (scan.colors is not None) is has_colors
        if has_colors:
            np.testing.assert_array_equal(scan.colors, COLORS)


def test_what_pye57_writes_it_reads_as_we_do(tmp_path: Path):
    pye57 = pytest.importorskip("pye57")
    path, names = tmp_path / "a.e57", ("cartesianX", "cartesianY", "cartesianZ")
    shades: dict[str, FloatArray | ByteArray] = dict(
        zip(("colorRed", "colorGreen", "colorBlue"), COLORS.T, strict=True)
    )
    turn, shift = np.array([0.8, 0, 0.6, 0]), np.array([4e5, 5e6, 100.0])
    file = pye57.E57(str(path), mode="w")
    table = {**dict(zip(names, POINTS.T.copy(), strict=True)), **shades}
    file.write_scan_raw(table, name="one", rotation=turn, translation=shift)
    file.close()
    scan = read_scan(path)
    assert_is_cloud(scan, has_normals=False, has_colors=True)
    placed = pye57.E57(str(path)).read_scan(0, colors=True, ignore_missing_fields=True)
    assert scan.world_from_scan is not None
    theirs = np.stack([placed[name] for name in names], axis=1)
    np.testing.assert_allclose(scan.world_from_scan.apply(scan.points), theirs, atol=1e-8)
