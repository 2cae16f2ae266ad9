"""The viewing direction of a scan without a grid, from its points alone."""

import numpy as np

from scanweld.geometry.arrays import FloatArray


def principal_frame(points: FloatArray) -> FloatArray:
    """Right, down and the thinnest axis (3, 3) of points (N, 3), as rows; turns with the points."""
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    right = axes[:, 2] * _sign(((centred @ axes[:, 2]) ** 3).sum())
    thin = axes[:, 0] * _sign(((centred @ axes[:, 0]) ** 3).sum())
    return np.stack([right, np.cross(thin, right), thin])


def depth_image(points: FloatArray, frame: FloatArray, cell: float) -> FloatArray:
    """Mean depth (H, W) along the third row of frame (3, 3) of points (N, 3); NaN where none."""
    right, down, depth = frame @ (points - points.mean(axis=0)).T
    columns = np.floor((right - right.min()) / cell).astype(np.int64)
    rows = np.floor((down - down.min()) / cell).astype(np.int64)
    shape = (int(rows.max()) + 1, int(columns.max()) + 1)
    cells = rows * shape[1] + columns
    count = np.bincount(cells, minlength=shape[0] * shape[1])
    total = np.bincount(cells, weights=depth, minlength=shape[0] * shape[1])
    image = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    return image.reshape(shape)


def _sign(value: float) -> float:
    return -1.0 if value < 0 else 1.0
