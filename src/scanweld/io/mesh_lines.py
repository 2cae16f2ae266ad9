"""Lines of meshes in text: their words, their faces, and what is said of a broken one.

Vertices keep the order of the file, which general mesh libraries do not promise.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scanweld.errors import ReadError
from scanweld.geometry.arrays import IntArray
from scanweld.io.raw import fan_triangles


def filled_lines(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Numbers and words of the lines that hold more than a comment."""
    for number, line in enumerate(data.splitlines(), start=1):
        words = line.partition(b"#")[0].split()
        if words:
            yield number, words


def broken_line(path: Path, number: int, words: list[bytes]) -> ReadError:
    """What is said of a line that cannot be read."""
    shown = b" ".join(words)[:40].decode("ascii", errors="replace")
    return ReadError(f"{path}: line {number}: {shown!r} is broken; correct it or export it anew")


def fan_faces(counts: list[int], corners: list[int]) -> IntArray | None:
    """Triangles (M, 3) of polygons with so many corners each, or None where there are none."""
    if not counts:
        return None
    return fan_triangles(np.array(counts, dtype=np.int64), np.array(corners, dtype=np.int64))
