"""The object is cut out of whole frames of a standing camera, and other scans stay as they are."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scanweld.cut import CutSet, cut_out, mask_of, mask_text, with_only
from scanweld.cut.pieces import Pieces, objects_of
from scanweld.errors import InputError
from scanweld.evaluation.primitives import box, cylinder
from scanweld.evaluation.turntable import EXACT, Shots, standing_room, turntable
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, Viewpoint
from scanweld.preparation.thinning import thinned
from tests.scenes import random_motion, small_creature
from tests.turntables import OBJECTS, SYMMETRIC, iou

FIVE_TURNS = (0.0, 38.0, 95.0, 187.0, 275.0)


@lru_cache
def shots(name: str) -> Shots:
    return turntable(OBJECTS[name](), FIVE_TURNS)


@lru_cache
def creature_cut() -> CutSet:
    return cut_out(shots("creature 0").scans, "auto")


def ious(made: Shots, cut: CutSet) -> list[float]:
    return [
        iou(mask, cut.kept[scan.name]) for scan, mask in zip(made.scans, made.masks, strict=True)
    ]


def depth_bytes(scans: tuple[RangeScan, ...]) -> list[bytes]:
    return [scan.points.tobytes() for scan in scans]


@pytest.mark.parametrize("name", OBJECTS)
def test_the_object_is_cut_out_of_noisy_frames(name: str):
    made = shots(name)
    assert np.median(ious(made, cut_out(made.scans, "auto"))) >= 0.93
    assert min(ious(made, cut_out(made.scans, "moving"))) >= 0.85


def test_it_is_cut_out_of_exact_frames_too():
    made = turntable(OBJECTS["vase with a handle"](), FIVE_TURNS, sensor=EXACT)
    assert min(ious(made, cut_out(made.scans, "auto"))) >= 0.97


def test_a_disc_that_looks_the_same_from_all_sides_is_cut_off_with_the_table():
    made = turntable(small_creature(), FIVE_TURNS, room=standing_room(disc=0.03))
    assert min(ious(made, cut_out(made.scans, "auto"))) >= 0.9


def test_a_cut_scan_has_what_was_kept_and_says_so():
    made, cut = shots("creature 0"), creature_cut()
    for whole, scan in zip(made.scans, cut.scans, strict=True):
        kept = cut.kept[scan.name]
        assert scan.grid is not None and whole.grid is not None
        assert np.array_equal(scan.grid >= 0, kept)
        assert scan.seen_beyond is not None
        is_patch = ((whole.grid >= 0) & ~kept) ^ scan.seen_beyond  # smaller than the object
        assert not (scan.seen_beyond & kept).any() and is_patch.sum() < 0.1 * is_patch.size
        assert scan.content_hash() != replace(scan, seen_beyond=None).content_hash()
        fewer = thinned(scan, scan.grid.size // 32)  # every second row and column
        assert fewer.seen_beyond is not None
        assert np.array_equal(fewer.seen_beyond, scan.seen_beyond[::2, ::2])
        assert np.array_equal(scan.points[scan.grid[kept]], whole.points[whole.grid[kept]])
        share = kept.sum() / (whole.grid >= 0).sum()
        assert scan.notes[-1] == f"cut: table and background, {share:.1%} of the pixels kept"
        assert scan.camera == whole.camera and scan.scan_from_sensor == whole.scan_from_sensor


def test_order_names_unit_and_frames_change_nothing():
    made, cut = shots("creature 0"), creature_cut()
    rng = np.random.default_rng(3)
    other = [
        replace(scan, name=f"x{scan.name}", points=4.0 * scan.points)
        for scan in reversed(made.scans)
    ]
    for k, motion in enumerate(random_motion(rng, 1.0) for _ in other):
        other[k] = replace(other[k], points=motion.apply(other[k].points), scan_from_sensor=motion)
    for name, mask in cut_out(other, "auto").kept.items():
        assert iou(mask, cut.kept[name[1:]]) > 0.995
    again = cut_out(made.scans[::-1], "auto")
    assert depth_bytes(again.scans[::-1]) == depth_bytes(cut.scans)


def test_a_frame_without_the_object_is_left_out_with_the_reason():
    made = turntable(small_creature(), FIVE_TURNS)
    nothing = turntable(box(), (0.0,), size=1e-4).scans[0]
    cut = cut_out([*made.scans, replace(nothing, name="table")], "auto")
    assert list(cut.empty) == ["table"]
    assert "the object is not seen in this frame" in cut.empty["table"]
    assert [scan.name for scan in cut.scans] == [scan.name for scan in made.scans]


# What is no such set of frames.


def masked(made: Shots) -> tuple[RangeScan, ...]:
    pairs = zip(made.scans, made.masks, strict=True)
    return tuple(with_only(scan, mask) for scan, mask in pairs)


def test_scans_of_an_object_alone_stay_the_very_same():
    for name in ("creature 0", "worn gear", "vase with a handle", "box"):
        scans = masked(shots(name))
        cut = cut_out(scans, "auto")
        assert all(a is b for a, b in zip(cut.scans, scans, strict=True)) and not cut.kept


REFUSED = {
    "the camera moved, or the object fills the frames": lambda: (
        turntable(small_creature(), FIVE_TURNS, camera_turns_deg=15.0).scans
    ),
    "nothing moved": lambda: turntable(small_creature(), (0.0,) * 4).scans,
    "nothing moved between": lambda: turntable(SYMMETRIC(), FIVE_TURNS).scans,
    "fewer than two frames saw anything": lambda: [
        scan.only(np.zeros(len(scan.points), dtype=bool)) for scan in shots("box").scans
    ],
    "no depth images of one pinhole camera": lambda: [
        replace(scan, grid=None, camera=None, scan_from_sensor=None, viewpoint=Viewpoint.UNKNOWN)
        for scan in shots("box").scans
    ],
    "do not lie where their camera sees them": lambda: [
        replace(scan, scan_from_sensor=Pose(rotation=np.eye(3), translation=np.array([0.1, 0, 0])))
        for scan in shots("box").scans
    ],
}


@pytest.mark.parametrize("reason", REFUSED)
def test_what_shows_nothing_that_moves_is_left_alone_or_refused(reason: str):
    scans = list(REFUSED[reason]())
    cut = cut_out(scans, "auto")
    assert all(a is b for a, b in zip(cut.scans, scans, strict=True)) and not cut.kept
    with pytest.raises(InputError, match=f"{reason}.*--object moving needs"):
        cut_out(scans, "moving")


def test_all_leaves_frames_alone():
    scans = shots("creature 0").scans
    assert all(a is b for a, b in zip(cut_out(scans, "all").scans, scans, strict=True))


def test_masks_survive_as_text():
    rng = np.random.default_rng(0)
    for shape, share in (((1, 1), 0.0), ((1, 1), 1.0), ((7, 5), 0.5), ((3, 9), 0.0), ((4, 4), 1.0)):
        mask = rng.random(shape) < share
        assert np.array_equal(mask_of(mask_text(mask)), mask)
    for text in ("", "3x3 4", "2x2 5,-1", "2 4", "0x0 0", "2x2 a"):
        with pytest.raises(ValueError):
            mask_of(text)


def test_a_mask_of_a_thinned_scan_fits_the_whole_one():
    whole = shots("box").scans[0]
    assert whole.grid is not None
    kept = np.zeros((80, 107), dtype=bool)
    kept[10:20, 30:40] = True
    scan = with_only(whole, kept)
    assert scan.grid is not None
    assert set(np.flatnonzero((scan.grid >= 0).any(axis=1))) <= set(range(30, 60))
    assert len(scan.points) == (whole.grid[30:60, 90:120] >= 0).sum()
    with pytest.raises(ValueError, match="not the one that was cut"):
        with_only(replace(cylinder_scan(), grid=np.zeros((200, 900), dtype=np.int64)), kept)


def cylinder_scan() -> RangeScan:
    return RangeScan(name="points", points=cylinder().vertices)


def test_a_part_that_is_nearer_to_the_middle_is_not_taken_for_the_object():
    rng = np.random.default_rng(3)
    cloud = lambda count, size, place: rng.uniform(-size, size, (count, 3)) + place  # noqa: E731
    pieces = [
        Pieces(masks=(np.arange(900),), points=(cloud(900, 0.06, (0.0, 0.0, 0.5)),)),
        Pieces(masks=(np.arange(900),), points=(cloud(900, 0.06, (0.0, 0.0, 0.5)),)),
        Pieces(
            masks=(np.arange(900), np.arange(900, 1100)),
            points=(cloud(900, 0.06, (0.0, 0.0, 0.44)), cloud(200, 0.01, (0.0, 0.0, 0.52))),
        ),
    ]
    assert [len(found) for found in objects_of(pieces)] == [900, 900, 1100]
    hand = cloud(950, 0.06, (0.4, 0.0, 0.5))
    pieces[0] = Pieces(
        masks=(np.arange(950), np.arange(950, 1850)), points=(hand, pieces[0].points[0])
    )
    assert [len(found) for found in objects_of(pieces)] == [900, 900, 1100]
