"""How fast files of two million points are read, in CPU seconds, and how much memory that takes.

    python -m benchmarks.reading                   every binary format
    python -m benchmarks.reading --files mesh.stl  some of them; the others' records stay

``python -m benchmarks.pages`` writes the table of docs/formats.md.

Each file is read in a process of its own, after a small one, so that compiled code is loaded.
"""

import argparse
import gzip
import multiprocessing
import struct
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks import fuzz
from benchmarks.results import DATA, Json, read_results, write_results
from benchmarks.sample_files import e57_of, las_of, npy, npz, pcd_head
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.io import read_scan
from scanweld.io.mesh_write import glb_bytes, stl_bytes
from scanweld.work.stage_log import peak_memory_mb

ROWS, COLUMNS = 1000, 2000
MOST_SECONDS = 2.0
_LITERALS = 32
"""Bytes that LZF takes over as they are, at most, after one that says how many."""


def points() -> FloatArray:
    """A grid of points (N, 3), rough as measured ones, exact in single precision."""
    v, u = np.mgrid[:ROWS, :COLUMNS] / COLUMNS
    rough = np.random.default_rng(0).normal(scale=1e-4, size=u.shape)
    grid = np.stack([u, v, 2 + np.sin(9 * u) * np.cos(7 * v) / 9 + rough], axis=-1)
    return grid.reshape(-1, 3).astype(np.float32).astype(np.float64)


def _faces() -> IntArray:
    corner = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    a, b, c, d = (
        x.ravel() for x in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:])
    )
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])


def _ply(kind: str, *, with_faces: bool = False) -> bytes:
    found = points().astype(kind)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(found)}\n"
    name = "float" if kind == "<f4" else "double"
    head += "".join(f"property {name} {axis}\n" for axis in "xyz")
    if not with_faces:
        return head.encode() + b"end_header\n" + found.tobytes()
    corners = _faces()
    faces = np.zeros(len(corners), [("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, corners
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    return head.encode() + found.tobytes() + faces.tobytes()


def _pcd(*, is_compressed: bool) -> bytes:
    found = points().astype("<f4")
    kind = "binary_compressed" if is_compressed else "binary"
    head = pcd_head("x y z", "4 4 4", "F F F", kind, shape=(ROWS, COLUMNS))
    if not is_compressed:
        return head + found.tobytes()
    whole = np.frombuffer(np.ascontiguousarray(found.T).tobytes(), np.uint8)
    pieces = whole.reshape(-1, _LITERALS)
    packed = np.insert(pieces, 0, _LITERALS - 1, axis=1).tobytes()
    return head + struct.pack("<II", len(packed), len(whole)) + packed


def _e57() -> bytes:
    rows, columns = np.mgrid[:ROWS, :COLUMNS].reshape(2, -1)
    table = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), points().T.copy(), strict=True))
    return e57_of(one=({**table, "rowIndex": rows, "columnIndex": columns}, {}))


def _las(*, is_packed: bool) -> bytes:
    return las_of(points(), 1e-5, np.zeros(3), is_packed=is_packed)


def _grid() -> FloatArray:
    return points().reshape(ROWS, COLUMNS, 3)


def _vtk() -> bytes:
    head = f"# vtk DataFile Version 4.2\na\nBINARY\nDATASET STRUCTURED_GRID\nDIMENSIONS {COLUMNS} "
    head += f"{ROWS} 1\nPOINTS {ROWS * COLUMNS} float\n"
    return head.encode() + points().astype(">f4").tobytes()


def _mesh() -> TriangleMesh:
    return TriangleMesh(vertices=points(), faces=_faces())


FILES: dict[str, Callable[[], bytes]] = {
    "float.ply": lambda: _ply("<f4"),
    "double.ply": lambda: _ply("<f8"),
    "mesh.ply": lambda: _ply("<f4", with_faces=True),
    "float.ply.gz": lambda: gzip.compress(_ply("<f4"), compresslevel=1),
    "binary.pcd": lambda: _pcd(is_compressed=False),
    "compressed.pcd": lambda: _pcd(is_compressed=True),
    "grid.e57": _e57,
    "points.las": lambda: _las(is_packed=False),
    "points.laz": lambda: _las(is_packed=True),
    "grid.npy": lambda: npy(_grid()),
    "grid.npz": lambda: npz(points=_grid()),
    "grid.vtk": _vtk,
    "mesh.glb": lambda: glb_bytes(_mesh()),
    "mesh.stl": lambda: stl_bytes(_mesh()),
}
"""Makers of the files by their names."""
WARM = {"mesh.stl": "binary.stl", "mesh.ply": "big_endian.ply", "compressed.pcd": "compressed.pcd"}
"""Small files whose reading loads the compiled code that others need."""


def measured(path: Path) -> Json:
    """How long a file takes to be read, and how much memory at most."""
    if path.name in WARM:
        small = path.with_name(f"small{path.suffix}")
        small.write_bytes(fuzz.samples()[WARM[path.name]]())
        read_scan(small)
    before, begin = peak_memory_mb(), time.process_time()
    count = len(read_scan(path).points)
    seconds = time.process_time() - begin
    return {
        **{"name": path.name, "points": count, "size": path.stat().st_size / 1e6},
        **{"seconds": seconds, "megabytes": peak_memory_mb() - before},
    }


def _write(path: Path) -> None:
    path.write_bytes(FILES[path.name]())


def over_files(records: Sequence[Json]) -> Json:
    """The records, and the floor."""
    return {"files": records, "most": MOST_SECONDS}


def main() -> int:
    """Measure every file, each in a process of its own; 1 if one takes too long."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reading", description=__doc__)
    parser.add_argument("--files", nargs="+", choices=FILES, default=tuple(FILES))
    parser.add_argument("--out", type=Path, default=DATA / "reading.json")
    options = parser.parse_args()
    records = {}
    if options.out.is_file():
        records = {record["name"]: record for record in read_results(options.out)["records"]}
    fork = multiprocessing.get_context("fork")
    for name in options.files:
        with tempfile.TemporaryDirectory() as folder, fork.Pool(1, maxtasksperchild=1) as pool:
            pool.apply(_write, (Path(folder) / name,))
            records[name] = pool.apply(measured, (Path(folder) / name,))
        print(records[name], flush=True)
        write_results(options.out, [records[name] for name in FILES if name in records])
    return int(any(record["seconds"] > MOST_SECONDS for record in records.values()))


if __name__ == "__main__":
    sys.exit(main())
