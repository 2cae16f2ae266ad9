"""The nearest point within a radius, against looking at all of them."""

import numpy as np
from scipy.spatial import KDTree

from scanweld.geometry.buckets import are_beside, cells_of, into_buckets, nearest_within


def test_nearest_points_are_found_wherever_they_are():
    rng = np.random.default_rng(0)
    points = rng.uniform(-3.0, 3.0, (2000, 3))
    places = rng.uniform(-3.5, 3.5, (500, 3))
    order, start = into_buckets(points, 0.5)
    assert sorted(order) == list(range(len(points))) and start[-1] == len(points)
    found = [nearest_within(points, order, start, 0.25, *place) for place in places]
    apart, nearest = KDTree(points).query(places, distance_upper_bound=0.25)
    np.testing.assert_array_equal(found, np.where(np.isfinite(apart), nearest, -1))
    assert 0 < np.isfinite(apart).sum() < len(places)


def test_few_points_and_none():
    for points in (np.zeros((0, 3)), np.ones((1, 3))):
        order, start = into_buckets(points, 1.0)
        assert nearest_within(points, order, start, 0.5, 1.2, 1.0, 1.0) == len(points) - 1


def test_points_with_enough_neighbours():
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (3000, 3))
    for enough in (1, 4):
        apart, _ = KDTree(points).query(points, k=enough + 1)
        found = are_beside(points, *into_buckets(points, 0.5), 0.25, enough)
        np.testing.assert_array_equal(found, apart[:, -1] < 0.25)
        assert 0 < found.sum() < len(points)


def test_cells_are_numbered_in_the_order_of_their_places():
    points = np.random.default_rng(2).normal((-40.0, 7.0, 0.0), 3.0, (500, 3))
    places = np.floor(points / 1.5).astype(np.int64)
    _, cell, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    for found, expected in zip(cells_of(points, 1.5), (cell.ravel(), count), strict=True):
        np.testing.assert_array_equal(found, expected)
    assert 1 < count.max() < len(count)
