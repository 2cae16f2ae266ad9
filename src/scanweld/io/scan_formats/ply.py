"""PLY of Stanford, ASCII or binary: points, range grids and meshes, with a sensor's place."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import LARGEST_EXACT, ByteArray, FloatArray, IntArray
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.pose import Pose
from scanweld.io.matrices import pose_from_numbers
from scanweld.io.ply_body import Columns, Ragged, decode_body
from scanweld.io.ply_header import PlyElement, PlyHeader, parse_header
from scanweld.io.raw import RawScan, fan_triangles, full_grid, noted_bytes, side_by_side
from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.viewed_from import viewpoint_told

CAMERA_KEY = "scanweld_camera"
"""``obj_info`` key of a camera: model, width, height, fx, fy, cx, cy."""
POSE_KEY = "scanweld_scan_from_sensor"
"""``obj_info`` key of the sensor's pose: a 4x4 matrix, row after row."""

_COLORS = (
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
)
_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))
_OF_MODELS = ("confidence", "support", "stdev", "filled", "scan")
_KNOWN = {*"xyz", "intensity", "alpha", *_OF_MODELS}.union(*_NORMALS, *_COLORS)
"""Properties of a vertex that are read, or need no word."""
_ELEMENTS = ("vertex", "face", "range_grid", "camera")
_SHORT_NUMBER = re.compile(r"[0-9]{1,9}")
_PLACE = ("view_px", "view_py", "view_pz")
_AXES = tuple(f"{axis}_axis{part}" for axis in "xyz" for part in "xyz")
_INDEX_LISTS = ("vertex_indices", "vertex_index")


def read_ply(path: Path, data: bytes) -> RawScan:
    """A PLY file's points, range grid, faces, colours, confidence and sensor.

    Args:
        path: The file, for messages.
        data: Its bytes.

    Raises:
        ReadError: If the file is broken or holds no vertices with x, y and z.
    """
    header = parse_header(path, data)
    tables = decode_body(header, data)
    element = header.element("vertex")
    if element is None:
        raise ReadError(f"{path}: has no element 'vertex'; export the scan with its points")
    vertex = tables["vertex"]
    points = _stack(vertex, ("x", "y", "z"))
    if points is None:
        raise ReadError(f"{path}: its vertices lack x, y or z; export the scan with its points")
    grid, notes = _grid(header, tables)
    camera = _camera(header)
    if camera is not None and grid is not None and grid.shape != (camera.height, camera.width):
        raise ReadError(
            f"{path}: the camera in its obj_info has {camera.width} x {camera.height} pixels, the "
            f"range grid {grid.shape[1]} x {grid.shape[0]} cells; correct either"
        )
    pose = _sensor_pose(header)
    if pose is None and grid is None:
        pose, told = _seen_from(tables.get("camera", {}), points)
        notes += told
    intensity, no_shades = _bytes("intensities", element, vertex, ("intensity",))
    colors, no_colors = _colors(element, vertex)
    ignored = [name for name in vertex if name not in _KNOWN]
    others = [element.name for element in header.elements if element.name not in _ELEMENTS]
    told = tuple(
        f"{what} ignored: {', '.join(names)[:200]}"
        for what, names in (("properties", ignored), ("elements", others))
        if names
    )
    notes += (*no_shades, *no_colors, *told)
    return RawScan(
        points=points,
        grid=grid,
        faces=_faces(header, tables),
        normals=next((n for names in _NORMALS if (n := _stack(vertex, names)) is not None), None),
        colors=colors,
        intensity=None if intensity is None else intensity[:, 0],
        confidence=_column(vertex, "confidence"),
        support=_column(vertex, "support"),
        stdev=_column(vertex, "stdev"),
        filled=_column(vertex, "filled"),
        camera=camera,
        scan_from_sensor=pose,
        notes=notes,
    )


def _stack(columns: Columns, names: tuple[str, ...]) -> FloatArray | None:
    """Scalar columns side by side (N, k), or None if one is missing."""
    found = _scalars(columns, names)
    return None if found is None else side_by_side(found)


def _column(columns: Columns, name: str) -> FloatArray | None:
    """A scalar column (N,), or None if it is missing."""
    found = _stack(columns, (name,))
    return None if found is None else found[:, 0]


def _scalars(columns: Columns, names: tuple[str, ...]) -> list[NDArray] | None:
    """Scalar columns by their names, or None if one is missing."""
    found = [columns.get(name) for name in names]
    scalars = [column for column in found if isinstance(column, np.ndarray)]
    return scalars if len(scalars) == len(names) else None


def _bytes(
    what: str, element: PlyElement, columns: Columns, names: tuple[str, ...]
) -> tuple[ByteArray | None, tuple[str, ...]]:
    """Columns as bytes (N, k), by the types that the header declares, and a note on them."""
    types = {prop.name: prop.type for prop in element.properties}
    found = _scalars(columns, names)
    if found is None:
        return None, ()
    if all(types[name] == "u1" for name in names):
        return np.stack(found, axis=1), ()
    return noted_bytes(what, side_by_side(found), types[names[0]])


def _colors(element: PlyElement, columns: Columns) -> tuple[ByteArray | None, tuple[str, ...]]:
    """Red, green and blue (N, 3), under the first of their usual names that is there."""
    there = (names for names in _COLORS if _scalars(columns, names) is not None)
    names = next(there, None)
    return (None, ()) if names is None else _bytes("colours", element, columns, names)


def _index_list(path: Path, columns: Columns) -> tuple[IntArray | ByteArray, IntArray] | None:
    """Lengths and values of the element's list of vertex indices."""
    column = next((columns[name] for name in _INDEX_LISTS if name in columns), None)
    if not isinstance(column, Ragged):
        return None
    values = column.values
    if not ((np.abs(values) < LARGEST_EXACT) & (values == np.rint(values))).all():
        raise ReadError(f"{path}: a vertex index is not a whole number; export the file anew")
    return column.counts, values.astype(np.int64)


def _grid(header: PlyHeader, tables: dict[str, Columns]) -> tuple[IntArray | None, tuple[str, ...]]:
    """The range grid (rows, columns) of vertex indices, -1 where a cell is empty."""
    element = header.element("range_grid")
    if element is None or element.count == 0:
        return _grid_of_all(header)
    cells = _index_list(header.path, tables["range_grid"])
    if cells is None:
        raise ReadError(f"{header.path}: its range_grid has no list vertex_indices; export it anew")
    shape = (header.info.get("num_rows", ""), header.info.get("num_cols", ""))
    if not all(_SHORT_NUMBER.fullmatch(text) for text in shape):
        return None, ("range grid of unknown shape left out",)
    rows, columns = (int(text) for text in shape)
    if rows * columns != element.count:
        raise ReadError(
            f"{header.path}: its range_grid has {element.count} cells, not num_rows x num_cols = "
            f"{rows} x {columns}; export it anew"
        )
    counts, values = cells
    if counts.max() > 1:
        raise ReadError(
            f"{header.path}: a cell of its range_grid holds several points; export it anew"
        )
    grid = np.full((rows, columns), -1, dtype=np.int64)
    grid.reshape(-1)[counts == 1] = values
    return grid, ()


def _grid_of_all(header: PlyHeader) -> tuple[IntArray | None, tuple[str, ...]]:
    """The grid of vertices that stand in its order, NaN where nothing was seen, as PCL writes."""
    shape = [header.info.get(key, "") for key in ("num_rows", "num_cols")]
    vertex = header.element("vertex")
    if vertex is None or not all(_SHORT_NUMBER.fullmatch(text) for text in shape):
        return None, ()
    rows, columns = (int(text) for text in shape)
    if rows * columns != vertex.count:
        return None, (f"its num_cols x num_rows, {columns} x {rows}, are not its points: ignored",)
    return (full_grid(rows, columns) if min(rows, columns) > 1 else None), ()


def _faces(header: PlyHeader, tables: dict[str, Columns]) -> IntArray | None:
    polygons = _index_list(header.path, tables.get("face", {}))
    return None if polygons is None else fan_triangles(polygons[0].astype(np.int64), polygons[1])


def _camera(header: PlyHeader) -> Camera | None:
    """The camera that a virtual scanner wrote down."""
    text = header.info.get(CAMERA_KEY)
    if text is None:
        return None
    try:
        model, *numbers = text.split()
        width, height = (int(word) for word in numbers[:2])
        fx, fy, cx, cy = (float(word) for word in numbers[2:])
        return Camera(
            model=CameraModel[model.upper()], width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy
        )
    except (ValueError, KeyError) as error:
        raise ReadError(
            f"{header.path}: 'obj_info {CAMERA_KEY} {text}' is not a model, width, height, fx, fy, "
            "cx and cy; correct or remove the line"
        ) from error


def _seen_from(columns: Columns, points: FloatArray) -> tuple[Pose | None, tuple[str, ...]]:
    """The sensor at the place of the element ``camera``, and notes on it.

    PCL and MeshLab (VCG) mean opposite directions by its axes, so only its place is believed; and
    that not if it is the origin with axes as they are, which PCL writes where it knows nothing.
    """
    place, axes = _stack(columns, _PLACE), _stack(columns, _AXES)
    if place is None or len(place) != 1:
        return None, ()
    told = () if axes is None else axes[0]
    return viewpoint_told(points, place[0], np.array_equal(told, np.eye(3).ravel()), "camera")


def _sensor_pose(header: PlyHeader) -> Pose | None:
    text = header.info.get(POSE_KEY)
    if text is None:
        return None
    try:
        return pose_from_numbers([float(word) for word in text.split()])
    except ValueError as error:
        raise ReadError(
            f"{header.path}: 'obj_info {POSE_KEY}' is not a rigid motion of 16 numbers ({error}); "
            "correct or remove the line"
        ) from error


FORMAT = ScanFormat(
    suffixes=(".ply",),
    read=read_ply,
    begins=(b"ply\n", b"ply\r"),
    keeps=(Keeps.GRID, Keeps.SENSOR, Keeps.FACES, Keeps.NORMALS, Keeps.COLORS),
)
