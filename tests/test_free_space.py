"""What a scan calls free, and what unknown."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from scanweld.cut import with_only
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import view_of
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.camera import CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.prepared import PixelKind
from scanweld.preparation import prepare
from scanweld.preparation.silhouette import classify_pixels, close
from tests.depth_scans import CONFIG, MODELS, ball, bumps, kind_at, scan_of_depth, xy_of


def test_an_enclosed_hole_is_unknown_and_the_outside_is_free():
    """A flat ring, radii 20 and 50, from above. Free pixels know how far outside they are."""
    made = trimesh.creation.annulus(r_min=20, r_max=50, height=10, sections=128)
    mesh = TriangleMesh(vertices=np.asarray(made.vertices), faces=np.asarray(made.faces))
    view = view_of(mesh, 0, 90, pixels=120, model=CameraModel.ORTHOGRAPHIC)
    scan = prepare(scan_mesh(mesh, view.camera, view.world_from_sensor), CONFIG)
    x, y = xy_of(scan)
    radius, kind = np.hypot(x, y), scan.image.kind
    slack = 1.5 * scan.image.pixel
    assert (kind[radius < 20 - slack] == PixelKind.UNKNOWN).all()
    assert (kind[(radius > 20 + slack) & (radius < 50 - slack)] == PixelKind.SURFACE).all()
    reach = 0.5 * view.camera.width / view.camera.fx
    in_view = np.maximum(np.abs(x), np.abs(y)) < reach - scan.image.pixel
    assert (kind[in_view & (radius > 50 + slack)] == PixelKind.FREE).all()
    assert (kind[np.maximum(np.abs(x), np.abs(y)) > reach] == PixelKind.UNKNOWN).all()
    outside, is_free = scan.image.outside, kind == PixelKind.FREE
    np.testing.assert_allclose(outside[is_free], radius[is_free] - 50, atol=slack)
    assert (outside[~is_free] == 0).all()


def test_beyond_the_field_of_view_nothing_is_known():
    """The right half of the patch is outside the image: there is no free space to the right.

    A horseshoe, open to the right, where the image ends: its inside may be a hole.
    """
    depth = bumps()
    whole, cut = (prepare(scan_of_depth(d), CONFIG) for d in (depth, depth[:, :45]))
    for x in (46.0, 48.0):
        assert kind_at(whole, x, 45) is PixelKind.SURFACE
        assert kind_at(cut, x, 45) is PixelKind.UNKNOWN
    assert (cut.image.kind[xy_of(cut)[0] > 45] == PixelKind.UNKNOWN).all()
    for scan in (whole, cut):
        assert kind_at(scan, 11, 45) is PixelKind.FREE
        assert kind_at(scan, 30, 11) is PixelKind.FREE
    depth[30:60, 30:] = np.nan
    whole, cut = (prepare(scan_of_depth(d), CONFIG) for d in (depth, depth[:, :70]))
    assert kind_at(whole, 60, 45) is PixelKind.FREE
    assert kind_at(cut, 60, 45) is PixelKind.UNKNOWN
    assert kind_at(cut, 40, 11) is PixelKind.FREE


def test_every_image_has_free_space_all_around():
    """As wide as the closing, no surface touches the border; also where there is no camera."""
    blind = replace(scan_of_depth(bumps()[:, :45]), camera=None, grid=None)
    for scan in (*(ball(model)[0] for model in MODELS), prepare(blind, CONFIG)):
        kind = scan.image.kind
        border = np.concatenate([kind[0], kind[-1], kind[:, 0], kind[:, -1]])
        assert set(border) <= {PixelKind.FREE, PixelKind.UNKNOWN}
        assert (kind == PixelKind.FREE).any()


def test_lost_returns_are_filled_or_unknown_never_free():
    depth = bumps()
    rng = np.random.default_rng(8)
    depth[rng.random(depth.shape) < 0.1] = np.nan
    depth[40:52, 40:52] = np.nan
    scan = prepare(scan_of_depth(depth), CONFIG)
    x, y = xy_of(scan)
    inside = (np.abs(x - 44.5) < 28) & (np.abs(y - 44.5) < 28)
    kind = scan.image.kind
    assert (kind[inside] != PixelKind.FREE).all()
    assert kind_at(scan, 46, 46) is PixelKind.UNKNOWN
    lost = np.isnan(depth[17:38, 17:38]).mean()
    patch = (np.abs(x - 27) < 10) & (np.abs(y - 27) < 10)
    assert (kind[patch] != PixelKind.SURFACE).mean() < 0.2 * lost


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_where_nothing_came_back_no_outline_is_known_if_the_background_did(share: float):
    """A patch before a wall, with a bay into it, and a wide ring without return around both.

    The wall may be seen to its end, or in so few pixels that it is out of reach for the most part.
    """
    patch, wall = bumps(200, 200, margin=60), np.full((200, 200), 400.0)
    patch[90:110, 110:] = np.nan
    v, u = np.mgrid[:200, :200]
    wall[(np.maximum(abs(u - 99.5), abs(v - 99.5)) < 45) | (v > share * 200)] = np.nan
    kept = np.isfinite(patch)
    whole = scan_of_depth(np.where(kept, patch, wall))
    cut, never = prepare(with_only(whole, kept), CONFIG), prepare(scan_of_depth(patch), CONFIG)
    for scan in (cut, never):
        assert all(kind_at(scan, *at) is PixelKind.FREE for at in ((122, 100), (57, 57), (52, 60)))
    outside, is_free = cut.image.outside, cut.image.kind == PixelKind.FREE
    if share < 0.5:
        np.testing.assert_array_equal(outside, never.image.outside)
        return
    away = np.maximum(*(np.abs(each - 99.5) for each in xy_of(cut))) - 45  # of the ring's outside
    assert not outside[away < -1].any() and (outside[is_free & (away > 1)] > 0).all()
    assert (outside <= np.sqrt(2) * np.maximum(away + 2, 0)).all()


def notched(width: int) -> BoolArray:
    mask = np.zeros((80, 80), dtype=bool)
    mask[20:60, 20:60] = True
    mask[20:45, 40 - width // 2 : 40 + width // 2] = False
    return mask


def test_a_narrow_notch_is_unknown_a_wide_one_free():
    """A gap narrower than twice the closing radius may as well be a shadow."""
    everywhere = np.ones((80, 80), dtype=bool)
    narrow, _ = classify_pixels(notched(6), everywhere, ~everywhere, 5.0)
    wide, outside = classify_pixels(notched(24), everywhere, ~everywhere, 5.0)
    assert narrow[25, 40] == PixelKind.UNKNOWN
    assert wide[25, 40] == PixelKind.FREE
    assert outside[25, 40] == pytest.approx(12, abs=1.5)
    # Closing changes nothing convex and shrinks nothing.
    v, u = np.mgrid[:60, :60]
    disc, comb = np.hypot(u - 30, v - 30) <= 15, notched(4)
    np.testing.assert_array_equal(close(disc, 6.0), disc)
    assert (close(comb, 4.0) >= comb).all() and close(comb, 4.0)[30, 40]
    np.testing.assert_array_equal(close(comb, 0.0), comb)
