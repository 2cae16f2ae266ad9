"""VTK legacy files, ASCII or binary: points, polygons, normals and colours.

Specification: "VTK File Formats", simple legacy formats, versions 1 to 5. Of the data sets
POLYDATA, UNSTRUCTURED_GRID and STRUCTURED_GRID (whose points are a grid) are read.
"""

from collections.abc import Callable
from enum import IntEnum
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import ByteArray, FloatArray, IntArray
from scanweld.io.raw import RawScan, fan_triangles, full_grid, to_bytes
from scanweld.io.scan_formats.records import Keeps, ScanFormat
from scanweld.io.vtk_body import VtkBody

_DATASETS = ("POLYDATA", "UNSTRUCTURED_GRID", "STRUCTURED_GRID")


class Polygon(IntEnum):
    """Types of cells that are polygons."""

    TRIANGLE = 5
    POLYGON = 7
    QUAD = 9


def read_vtk(path: Path, data: bytes) -> RawScan:
    """Points, polygons, normals and colours of a VTK legacy file.

    What stands behind something that is not known cannot be found; a note names it.

    Raises:
        ReadError: If it is no such file, holds another data set, or is broken.
    """
    if not data.startswith(b"# vtk DataFile"):
        raise ReadError(f"{path}: not a VTK legacy file; save the points as one, or as PLY")
    body = VtkBody(path, data, 0, is_binary=False)
    body.rest_of_line()
    body.rest_of_line()  # the title, which may be blank
    encoding, dataset = ([word.upper() for word in body.line()] for _ in range(2))
    if encoding not in (["ASCII"], ["BINARY"]):
        raise ReadError(f"{path}: is neither ASCII nor BINARY; save it anew")
    if dataset[:1] != ["DATASET"] or dataset[1:] not in ([name] for name in _DATASETS):
        raise ReadError(f"{path}: holds no {' or '.join(_DATASETS)}; save the points as POLYDATA")
    body.is_binary = encoding == ["BINARY"]
    return _Sections(body).read()


class _Sections:
    """The sections of a body, read one after the other."""

    def __init__(self, body: VtkBody) -> None:
        self.body = body
        self.points: FloatArray | None = None
        self.normals: FloatArray | None = None
        self.colors: ByteArray | None = None
        self.cells: tuple[IntArray, IntArray] | None = None
        self.faces: IntArray | None = None
        self.dimensions: list[int] = []
        self.num_values = 0
        self.is_of_points = False
        self.notes: tuple[str, ...] = ()

    def read(self) -> RawScan:
        """All of them, up to the first that is not known."""
        known: dict[str, Callable[[list[str]], None]] = {
            **{"DIMENSIONS": self._dimensions, "POINTS": self._points, "CELLS": self._cells},
            **{"POLYGONS": self._polygons, "CELL_TYPES": self._cell_types},
            **dict.fromkeys(("VERTICES", "LINES"), self._other_cells),
            **{"TRIANGLE_STRIPS": self._strips},
            **{"POINT_DATA": self._point_data, "CELL_DATA": self._cell_data},
            **{"METADATA": self._metadata, "FIELD": self._field, "SCALARS": self._scalars},
            **{"NORMALS": self._normals, "VECTORS": self._vectors},
            **{"COLOR_SCALARS": self._color_scalars, "LOOKUP_TABLE": self._lookup_table},
        }
        while words := self.body.line():
            section = known.get(words[0].upper())
            if section is None:
                self.notes += (f"left out from {words[0][:40]} on",)
                break
            try:
                section(words[1:])
            except IndexError as error:
                raise self.body.broken(f"{' '.join(words)[:40]!r} is incomplete") from error
        if self.points is None:
            raise self.body.broken("holds no POINTS")
        return RawScan(
            points=self.points,
            normals=self.normals,
            colors=self.colors,
            faces=self.faces,
            grid=self._grid(len(self.points)),
            notes=self.notes,
        )

    def _grid(self, num_points: int) -> IntArray | None:
        sides = [n for n in self.dimensions if n > 1]
        if len(self.dimensions) != 3 or len(sides) != 2 or sides[0] * sides[1] != num_points:
            return None
        return full_grid(sides[1], sides[0])

    def _dimensions(self, told: list[str]) -> None:
        self.dimensions = [self.body.number(word) for word in told]

    def _points(self, told: list[str]) -> None:
        values = self.body.values(3 * self.body.number(told[0]), told[1])
        self.points = values.reshape(-1, 3).astype(np.float64)

    def _polygons(self, told: list[str]) -> None:
        self._other_cells(told)
        if self.cells is not None:
            self.faces = fan_triangles(*self.cells)

    def _cells(self, told: list[str]) -> None:
        self.cells = self.body.cells(self.body.number(told[0]), self.body.number(told[1]))

    def _other_cells(self, told: list[str]) -> None:
        self._cells(told)

    def _strips(self, told: list[str]) -> None:
        self._other_cells(told)
        self.notes += ("triangle strips left out",)

    def _cell_types(self, told: list[str]) -> None:
        types = self.body.values(self.body.number(told[0]), "int")
        if self.cells is None or len(self.cells[0]) != len(types):
            raise self.body.broken("its CELL_TYPES are not as many as its CELLS")
        counts, corners = self.cells
        is_polygon = np.isin(types, [*Polygon])
        faces = fan_triangles(counts[is_polygon], corners[np.repeat(is_polygon, counts)])
        self.faces = faces if len(faces) else None

    def _point_data(self, told: list[str]) -> None:
        self.num_values, self.is_of_points = self.body.number(told[0]), True
        if self.points is not None and self.num_values != len(self.points):
            raise self.body.broken("its POINT_DATA are not as many as its points")

    def _cell_data(self, told: list[str]) -> None:
        self.num_values, self.is_of_points = self.body.number(told[0]), False

    def _normals(self, told: list[str]) -> None:
        values = self.body.values(3 * self.num_values, told[1]).reshape(-1, 3)
        if self.is_of_points:
            self.normals = values.astype(np.float64)

    def _vectors(self, told: list[str]) -> None:
        self.body.values(3 * self.num_values, told[1])

    def _color_scalars(self, told: list[str]) -> None:
        width = self.body.number(told[1])
        stored = ("unsigned_char", "u1") if self.body.is_binary else ("float", "f4")
        values = self.body.values(width * self.num_values, stored[0])
        if width in (3, 4) and self.is_of_points:
            self.colors = to_bytes(values.reshape(-1, width)[:, :3], stored[1])

    def _scalars(self, told: list[str]) -> None:
        width = self.body.number(told[2]) if len(told) > 2 else 1
        begin = self.body.at
        if self.body.line()[:1] != ["LOOKUP_TABLE"]:
            self.body.at = begin
        self.body.values(width * self.num_values, told[1])

    def _lookup_table(self, told: list[str]) -> None:
        size = 4 * self.body.number(told[1])
        self.body.values(size, "unsigned_char" if self.body.is_binary else "float")

    def _field(self, told: list[str]) -> None:
        for _ in range(self.body.number(told[1])):
            words = self.body.line()
            if words[:1] == ["METADATA"]:
                self._metadata([])
                words = self.body.line()
            if not words:
                raise self.body.too_short()
            self.body.values(self.body.number(words[1]) * self.body.number(words[2]), words[3])

    def _metadata(self, told: list[str]) -> None:
        """It ends with a blank line."""
        while self.body.rest_of_line().strip():
            pass


FORMAT = ScanFormat(
    suffixes=(".vtk",),
    read=read_vtk,
    begins=(b"# vtk DataFile",),
    keeps=(Keeps.GRID, Keeps.FACES, Keeps.NORMALS, Keeps.COLORS),
)
