"""The 256 cases of marching cubes, derived rather than listed.

Corner c of a cell has the offsets (c & 1, c >> 1 & 1, c >> 2 & 1); edge 4 a + k runs along axis a.
On an ambiguous face the two inner corners are cut off one by one, so that neighbours agree; no
diagonal of a polygon lies in a face of the cell, so that no edge of the mesh has a third face.
"""

from functools import cache

import numpy as np

from scanweld.geometry.arrays import IntArray

Triangle = tuple[int, int, int]


def corner_offsets() -> IntArray:
    """(8, 3) offsets of a cell's corners."""
    corners = np.arange(8)
    return np.stack([corners & 1, corners >> 1 & 1, corners >> 2 & 1], axis=1)


def edge_corners() -> IntArray:
    """(12, 2) corners at the ends of the edges, the lower first; edge e runs along axis e // 4."""
    return np.array([[c, c | 1 << a] for a in range(3) for c in range(8) if not c >> a & 1])


@cache
def triangle_table() -> IntArray:
    """(256, T, 3) edges at the corners of each case's triangles, -1 after the last one.

    Bit c of the case: corner c is inside. Triangles are counter-clockwise seen from outside.
    """
    cases = [_triangles(case) for case in range(256)]
    table = np.full((256, max(map(len, cases)), 3), -1, dtype=np.int64)
    for case, triangles in enumerate(cases):
        if triangles:
            table[case, : len(triangles)] = triangles
    table.flags.writeable = False
    return table


def _faces() -> list[list[int]]:
    """Corners of the six faces, counter-clockwise seen from outside the cell."""
    faces = []
    for axis in range(3):
        b, c = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        faces.append([1 << axis | corner for corner in (0, b, b | c, c)])
        faces.append([0, c, b | c, b])
    return faces


def _edge_ids() -> dict[frozenset[int], int]:
    return {frozenset(pair): index for index, pair in enumerate(edge_corners().tolist())}


def _loops(case: int) -> list[list[int]]:
    """Closed polygons of a case, as edges; on each face they cut off every run of inner corners."""
    edge_of = _edge_ids()
    follower: dict[int, int] = {}
    for face in _faces():
        inside = [bool(case >> corner & 1) for corner in face]
        for k in range(4):
            if inside[k] or not inside[(k + 1) % 4]:
                continue
            last = next(m for m in range(k + 1, k + 4) if not inside[(m + 1) % 4])
            entry = edge_of[frozenset((face[k], face[(k + 1) % 4]))]
            exit_ = edge_of[frozenset((face[last % 4], face[(last + 1) % 4]))]
            follower[entry] = exit_
    loops = []
    while follower:
        start = min(follower)
        loop = [start]
        while (after := follower.pop(loop[-1])) != start:
            loop.append(after)
        loops.append(loop)
    return loops


def _triangles(case: int) -> list[Triangle]:
    triangles: list[Triangle] = []
    for loop in _loops(case):
        split = _split(loop)
        if split is None:
            raise AssertionError("unreachable: every loop of a cell's cases can be split")
        triangles += split
    return triangles


def _split(loop: list[int]) -> list[Triangle] | None:
    """Triangles of a polygon without a diagonal in a face of the cell; None if there are none."""
    if len(loop) == 2:
        return []
    a, b = loop[0], loop[-1]
    for k in range(1, len(loop) - 1):
        middle = loop[k]
        if (k > 1 and _share_face(a, middle)) or (k < len(loop) - 2 and _share_face(middle, b)):
            continue
        before, after = _split(loop[: k + 1]), _split(loop[k:])
        if before is not None and after is not None:
            return [*before, (a, middle, b), *after]
    return None


def _share_face(first: int, second: int) -> bool:
    ends = {*edge_corners()[first].tolist(), *edge_corners()[second].tolist()}
    return any(ends <= set(face) for face in _faces())
