"""What a carried camera looked at is cut out of its frames; where that is not known, nothing is."""

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pytest

from benchmarks.virtual.handheld import (
    around,
    exact_depth,
    looking,
    measured,
    pinhole,
    room,
    table_with,
    together,
)
from scanweld.cut import Stood, cut_out, with_only
from scanweld.geometry.arrays import BoolArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.geometry.scan import RangeScan
from tests.depth_scans import scan_of_depth
from tests.turntables import OBJECTS, iou
from tests.videos import KINECT

CAMERA, SIZE = pinhole(160), 0.2
UNKNOWN, ONE_WAY = "where it stood is not known", "looked one way"
NOT_ONE, NO_TABLE = "did not look at one place", "no table is seen"
BESIDE = "no one thing stands where it looked"


class Carried(NamedTuple):
    """Frames, which of their pixels show the object, and where they were taken, about."""

    scans: tuple[RangeScan, ...]
    masks: tuple[BoolArray, ...]
    stood: Stood


def taken(body: TriangleMesh, rest: list[TriangleMesh], poses: list[Pose]) -> Carried:
    """Frames of a body and all else, and start poses that are a degree and a centimetre off."""
    rng, scans, masks, stood = np.random.default_rng(3), [], [], {}
    for k, pose in enumerate(poses):
        exact = exact_depth(together([body, *rest]), pose, CAMERA)
        depth = measured(exact, KINECT, np.random.default_rng(k))
        own = exact_depth(body, pose, CAMERA)
        scans.append(replace(scan_of_depth(depth, CAMERA), name=f"{k}"))
        masks.append(np.isfinite(depth) & (own <= exact))
        off = Pose(
            rotation=rotation_exp(rng.normal(0, 0.01, 3)), translation=rng.normal(0, 6e-3, 3)
        )
        stood[f"{k}"] = pose @ off
    return Carried(tuple(scans), tuple(masks), Stood(poses=stood, components=[list(stood)]))


def split(whole: TriangleMesh, body: TriangleMesh) -> tuple[TriangleMesh, TriangleMesh]:
    """The first part of a mesh, which is as large as a body, and the rest."""
    own = (whole.faces < len(body.vertices)).all(axis=1)
    return replace(whole, faces=whole.faces[own]), replace(whole, faces=whole.faces[~own])


@lru_cache
def carried(name: str, turn_deg: float = 280.0, beside: float = 0.0) -> Carried:
    mesh = OBJECTS[name]()
    mesh = replace(mesh, vertices=mesh.vertices * [1.0, -1.0, -1.0])  # their z points down
    body, table = split(table_with(mesh, SIZE, 0.0), mesh)
    middle = np.array([beside, 0.0, 0.4 * SIZE])
    way = around(middle, 0.5, np.linspace(0, turn_deg, 8), np.random.default_rng(1))
    walls = room(np.random.default_rng(0))
    below = replace(walls, vertices=walls.vertices - [0.0, 0.0, 0.75])
    return taken(body, [table, below], way)


FIVE = ("creature 0", "creature 1", "box", "vase with a handle", "gear and box")


def test_the_object_is_cut_out_where_the_camera_was_carried_around_it():
    medians = []
    for name in FIVE:
        made = carried(name)
        cut = cut_out(made.scans, "auto", made.stood)
        assert set(cut.kept) == {scan.name for scan in made.scans} and not cut.empty
        found = [iou(m, cut.kept[s.name]) for s, m in zip(made.scans, made.masks, strict=True)]
        assert min(found) >= 0.7
        medians.append(np.median(found))
        assert all("cut: table and background" in scan.notes[-1] for scan in cut.scans)
    assert np.median(medians) >= 0.9 and min(medians) >= 0.85


def test_order_frame_and_unit_of_the_poses_change_nothing():
    made = carried("creature 0")
    kept = cut_out(made.scans, "auto", made.stood).kept
    far = Pose(rotation=rotation_exp(np.array([1.0, -2.0, 0.5])), translation=np.array([5.0, 1, 2]))
    moved = {name: far @ pose for name, pose in made.stood.poses.items()}
    again = cut_out(made.scans[::-1], "auto", replace(made.stood, poses=moved)).kept
    assert kept.keys() == again.keys()
    assert min(iou(kept[name], again[name]) for name in kept) > 0.999


def test_a_frame_without_a_pose_is_cut_where_it_looked_and_pieces_of_a_track_are_cut_alone():
    made = carried("creature 0")
    poses = dict(made.stood.poses)
    del poses["3"]
    for name in "4567":  # a piece of its own, in a frame of its own
        poses[name] = Pose(rotation=np.eye(3), translation=np.ones(3)) @ poses[name]
    stood = Stood(poses=poses, components=["012", "4567"])
    cut = cut_out(made.scans, "auto", stood)
    found = [iou(m, cut.kept[s.name]) for s, m in zip(made.scans, made.masks, strict=True)]
    assert np.median(found) >= 0.9 and min(found) >= 0.7


def nowhere() -> Carried:
    """A camera that turns about itself in a room."""
    walls = room(np.random.default_rng(0))
    eye = np.array([0.2, 0.1, 1.2])
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    way = [looking(eye, eye + np.array([np.cos(turn), np.sin(turn), -0.1])) for turn in turns]
    return taken(together([walls]), [], way)


def without_table() -> Carried:
    made = carried("creature 0")
    scans = [with_only(scan, mask) for scan, mask in zip(made.scans, made.masks, strict=True)]
    return made._replace(scans=tuple(scans))


@pytest.mark.parametrize("reason", [UNKNOWN, ONE_WAY, NOT_ONE, NO_TABLE, BESIDE])
def test_where_it_is_not_known_frames_stay_the_very_same_and_the_reason_is_told(reason: str):
    made = {
        UNKNOWN: lambda: carried("creature 0")._replace(stood=Stood(poses={}, components=[])),
        ONE_WAY: lambda: carried("creature 0", 10.0),
        NOT_ONE: nowhere,
        NO_TABLE: without_table,
        BESIDE: lambda: carried("creature 0", beside=0.15),
    }[reason]()
    cut = cut_out(made.scans, "auto", made.stood)
    assert reason in cut.reason and cut.kept == {}
    assert all(a is b for a, b in zip(cut.scans, made.scans, strict=True))


def test_all_keeps_all_that_a_carried_camera_saw():
    made = carried("creature 0")
    assert cut_out(made.scans, "all", made.stood).kept == {}
