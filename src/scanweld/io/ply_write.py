"""Writing scans and meshes as binary little-endian PLY."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.io.atomic import write_whole
from scanweld.io.local_origin import find_shift, shift_text
from scanweld.io.scan_formats.ply import CAMERA_KEY, POSE_KEY

_TYPE_NAMES = {"<f4": "float", "<f8": "double", "|u1": "uchar", "<i4": "int"}


def write_scan_ply(path: Path | str, scan: RangeScan) -> None:
    """Write a scan so that ``read_scan`` gives it back, to the last bit.

    The name, the notes and the count of dropped points are not written; the sensor's pose only
    where it was given, for one that was estimated would come back as given.

    Raises:
        WriteError: If the file cannot be written.
    """
    info: list[str] = []
    if scan.grid is not None:
        info += [f"num_cols {scan.grid.shape[1]}", f"num_rows {scan.grid.shape[0]}"]
    if scan.camera is not None:
        info.append(f"{CAMERA_KEY} {_camera_text(scan.camera)}")
    if scan.scan_from_sensor is not None and scan.viewpoint is Viewpoint.GIVEN:
        info.append(f"{POSE_KEY} {_pose_text(scan.scan_from_sensor)}")
    vertex = _vertex_fields(scan.points, scan.normals, scan.colors)
    if scan.confidence is not None:
        vertex["confidence"] = _lossless(scan.confidence)
    elements = [_scalar_element("vertex", vertex)]
    if scan.grid is not None:
        cells = scan.grid.reshape(-1)
        elements.append(_index_element("range_grid", cells[:, None], (cells >= 0).astype(np.uint8)))
    if scan.faces is not None:
        elements.append(_face_element(scan.faces))
    write_whole(Path(path), _file(info, elements))


def write_mesh_ply(path: Path | str, mesh: TriangleMesh, comments: Sequence[str] = ()) -> None:
    """Write a mesh with its normals, rounded to single precision, its colours, and what is known.

    The properties ``support``, ``stdev`` and ``filled`` are as in the mesh. A mesh far off is
    written about a local origin, which a comment tells.

    Args:
        path: Of the file.
        mesh: The mesh.
        comments: Further lines of the header.

    Raises:
        WriteError: If the file cannot be written.
    """
    normals = None if mesh.normals is None else mesh.normals.astype(np.float32)
    vertices, told = _about_local_origin(mesh.vertices, find_shift(mesh.vertices))
    vertex = _vertex_fields(vertices, normals, mesh.colors)
    if mesh.support is not None:
        vertex["support"] = mesh.support.astype("<i4")
    if mesh.stdev is not None:
        vertex["stdev"] = mesh.stdev.astype("<f4")
    if mesh.filled is not None:
        vertex["filled"] = mesh.filled.astype("|u1")
    elements = [_scalar_element("vertex", vertex), _face_element(mesh.faces)]
    write_whole(Path(path), _file([], elements, [*told, *comments]))


def points_ply_bytes(
    points: FloatArray,
    labels: IntArray,
    names: Sequence[str],
    colors: ByteArray | None,
    shift: FloatArray | None = None,
) -> bytes:
    """A PLY of points that know their scan: property ``scan`` of each vertex.

    Args:
        points: (N, 3).
        labels: (N,) which of the names each is of; comments ``scan K = NAME`` tell them.
        names: Of the scans, on one line each.
        colors: (N, 3) or None.
        shift: The local origin (3,) about which they are written, which a comment tells; or None.
    """
    points, told = _about_local_origin(points, shift)
    vertex = _vertex_fields(points, None, colors)
    vertex["scan"] = labels.astype("<i4")
    comments = [*told, *(f"scan {k} = {name}" for k, name in enumerate(names))]
    return _file([], [_scalar_element("vertex", vertex)], comments)


def _about_local_origin(
    points: FloatArray, shift: FloatArray | None
) -> tuple[FloatArray, list[str]]:
    """Points (N, 3) less the shift, and the comment that tells it."""
    return (points, []) if shift is None else (points - shift, [shift_text(shift)])


def _camera_text(camera: Camera) -> str:
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy)
    size = f"{camera.width} {camera.height}"
    return f"{camera.model.name.lower()} {size} {' '.join(f'{x:.17g}' for x in numbers)}"


def _pose_text(pose: Pose) -> str:
    return " ".join(f"{x:.17g}" for x in pose.matrix().ravel())


def _vertex_fields(
    points: FloatArray, normals: NDArray | None, colors: ByteArray | None
) -> dict[str, NDArray]:
    fields = dict(zip("xyz", _lossless(points).T, strict=True))
    if normals is not None:
        fields |= zip(("nx", "ny", "nz"), _lossless(normals).T, strict=True)
    if colors is not None:
        fields |= zip(("red", "green", "blue"), colors.T, strict=True)
    return fields


def _lossless(values: NDArray) -> NDArray:
    """The values as ``float`` where that loses nothing, else as ``double``."""
    with np.errstate(over="ignore", under="ignore"):
        single = values.astype("<f4")
    return single if np.array_equal(single, values) else values.astype("<f8")


def _scalar_element(name: str, fields: dict[str, NDArray]) -> tuple[list[str], bytes]:
    """Header lines and body of an element without lists."""
    num_rows = len(next(iter(fields.values())))
    table = np.zeros(num_rows, dtype=[(key, column.dtype) for key, column in fields.items()])
    for key, column in fields.items():
        table[key] = column
    header = [f"element {name} {num_rows}"]
    header += [f"property {_TYPE_NAMES[c.dtype.str]} {key}" for key, c in fields.items()]
    return header, table.tobytes()


def _face_element(faces: IntArray) -> tuple[list[str], bytes]:
    return _index_element("face", faces, np.full(len(faces), faces.shape[1], dtype=np.uint8))


def _index_element(name: str, lists: IntArray, counts: ByteArray) -> tuple[list[str], bytes]:
    """Header lines and body of an element of lists that are all full (k indices) or empty."""
    table = np.zeros(len(lists), dtype=[("n", "u1"), ("v", "<i4", (lists.shape[1],))])
    table["n"], table["v"] = counts, lists
    octets = table.view(np.uint8).reshape(len(lists), table.itemsize)
    kept = np.repeat((counts > 0)[:, None], table.itemsize, axis=1)
    kept[:, 0] = True
    header = [f"element {name} {len(lists)}", "property list uchar int vertex_indices"]
    return header, octets[kept].tobytes()


def _file(
    info: list[str], elements: list[tuple[list[str], bytes]], comments: Sequence[str] = ()
) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {line}" for line in comments]
    lines += [f"obj_info {line}" for line in info]
    for header, _ in elements:
        lines += header
    text = "\n".join([*lines, "end_header", ""])
    return text.encode("utf-8") + b"".join(body for _, body in elements)
