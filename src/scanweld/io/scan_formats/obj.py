"""OBJ of Wavefront: vertices, with colours behind their coordinates, and faces."""

from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.io.mesh_lines import broken_line, fan_faces, filled_lines
from scanweld.io.raw import RawScan, noted_bytes
from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.text import plain_number


def read_obj(path: Path, data: bytes) -> RawScan:
    """Vertices, their colours (if written behind the coordinates) and faces of an OBJ file.

    Raises:
        ReadError: If a line is broken or there are no vertices.
    """
    vertices: list[list[float]] = []
    counts: list[int] = []
    corners: list[int] = []
    for number, words in filled_lines(data.replace(b"\\\n", b" ").replace(b"\\\r\n", b" ")):
        try:
            if words[0] == b"v":
                vertices.append([plain_number(word) for word in words[1:]])
            elif words[0] == b"f":
                corners += (_obj_index(word, len(vertices)) for word in words[1:])
                counts.append(len(words) - 1)
        except ValueError as error:
            raise broken_line(path, number, words) from error
    sizes = sorted({len(vertex) for vertex in vertices})
    if not sizes:
        raise ReadError(f"{path}: holds no vertices; export the scan as a mesh or as points")
    faces = fan_faces(counts, corners)
    no_normals = ("normals left out",) if b"\nvn" in data else ()
    if sizes in ([3, 6], [4, 7]):
        note = "colours on some of its vertices only, so they were left out"
        points = np.array([vertex[:3] for vertex in vertices])
        return RawScan(points=points, faces=faces, notes=(note, *no_normals))
    if len(sizes) > 1 or sizes[0] not in (3, 4, 6, 7):
        raise ReadError(f"{path}: its vertices have {sizes} numbers, not all 3; export it anew")
    table = np.array(vertices)
    found = table[:, -3:] if sizes[0] >= 6 else None
    colors, notes = noted_bytes("colours", found, "f8")
    return RawScan(points=table[:, :3], faces=faces, colors=colors, notes=(*notes, *no_normals))


def _obj_index(word: bytes, num_vertices: int) -> int:
    """The vertex of a corner such as 7, 7/1, 7//3 or -1 (the last one so far), from 0."""
    index = int(word.partition(b"/")[0])
    if index == 0 or not -num_vertices <= index <= np.iinfo(np.int32).max:
        raise ValueError("OBJ counts from 1, or back from -1")
    return index - 1 if index > 0 else num_vertices + index


FORMAT = ScanFormat(suffixes=(".obj",), read=read_obj, keeps=(Keeps.FACES, Keeps.COLORS))
