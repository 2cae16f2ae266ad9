"""Fewer triangles for the screen: vertices in one cell of a grid become one."""

import numpy as np

from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.preparation.thinning import SLACK


def cluster_vertices(vertices: FloatArray, at_most: int) -> IntArray:
    """Number (V,) of the cluster of each vertex, from 0; at most so many, near ones together."""
    if len(vertices) <= at_most:
        return np.arange(len(vertices))
    low = vertices.min(axis=0)
    # A surface cut by n cubes along each side falls into some n^2 of them.
    cell = float((vertices.max(axis=0) - low).max()) / np.sqrt(at_most)
    while True:
        x, y, z = np.floor((vertices - low) / cell).astype(np.int64).T
        key = (x * (y.max() + 1) + y) * (z.max() + 1) + z
        numbers, cluster = np.unique(key, return_inverse=True)
        if len(numbers) <= at_most:
            return cluster.reshape(-1).astype(np.int64)
        cell *= max(SLACK, np.sqrt(len(numbers) / at_most))


def cluster_means(cluster: IntArray, values: FloatArray) -> FloatArray:
    """Mean (C, k) of the values (V, k) of each cluster, those that are NaN left out."""
    count = int(cluster.max()) + 1 if len(cluster) else 0
    means = np.full((count, values.shape[1]), np.nan)
    for k in range(values.shape[1]):
        known = np.isfinite(values[:, k])
        number = np.bincount(cluster[known], minlength=count)
        total = np.bincount(cluster[known], weights=values[known, k], minlength=count)
        np.divide(total, number, out=means[:, k], where=number > 0)
    return means


def cluster_faces(cluster: IntArray, faces: IntArray) -> IntArray:
    """Faces (F', 3) between clusters: without those that collapse, each once."""
    mapped = cluster[faces]
    a, b, c = mapped.T
    whole = mapped[(a != b) & (b != c) & (c != a)]
    size = int(cluster.max(initial=0)) + 1
    low, high = whole.min(axis=1), whole.max(axis=1)
    key = (low * size + (whole.sum(axis=1) - low - high)) * size + high
    _, first = np.unique(key, return_index=True)
    return whole[np.sort(first)]
