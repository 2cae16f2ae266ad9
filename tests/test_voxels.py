"""How fine a model is: as its scans' points, however many scans see the same."""

import logging

import numpy as np
import pytest

from scanweld.config import FusionConfig
from scanweld.evaluation.primitives import plate, sphere
from scanweld.fusion import fuse, voxel_edge
from scanweld.fusion.voxels import surface_spacing
from tests.posed_scans import RADIUS, scanned, views_of

OPEN = FusionConfig()


def area_of(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def test_spacing_is_that_along_the_surface():
    """A plate seen from straight before it, and so that its points are farther apart one way."""
    flat = plate(100.0, 80.0, 5.0)
    straight, oblique = scanned(flat, views_of(flat, [(0, 89.9), (0, 45)]))[0]
    assert surface_spacing(straight) == pytest.approx(straight.resolution, rel=0.05)
    assert surface_spacing(oblique) == pytest.approx(2**0.25 * oblique.resolution, rel=0.1)


@pytest.mark.parametrize("times", [1, 3])
def test_there_are_about_two_triangles_for_each_point_of_distinct_surface(times: int):
    scans, poses = scanned(sphere(RADIUS))
    mesh = fuse(scans * times, poses * times, OPEN)
    told = area_of(mesh.vertices, mesh.faces) / surface_spacing(scans[0]) ** 2
    assert 1.8 < len(mesh.faces) / told < 2.2


def test_scans_finer_than_voxels_may_be_are_told(caplog: pytest.LogCaptureFixture):
    scans, _ = scanned(sphere(RADIUS))
    wanted = FusionConfig(max_voxels_across=50, voxel_resolutions=0.5)
    with caplog.at_level(logging.WARNING):
        assert voxel_edge(scans, wanted) == pytest.approx(scans[0].diameter / 50, rel=0.01)
    (told,) = caplog.messages
    enough = int(told.split("max_voxels_across to ")[1].split()[0])
    caplog.clear()
    finer = wanted.model_copy(update={"max_voxels_across": enough})
    assert voxel_edge(scans, finer) < scans[0].diameter / 50
    assert not caplog.messages
