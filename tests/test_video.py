"""Video to keyframes: exact truth from rendered frames, and all that goes wrong on the way."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.virtual.handheld import (
    D435,
    EXACT,
    DepthSensor,
    around,
    looking,
    table_with,
)
from scanweld.video.keyframes import keyframes
from scanweld.video.levels import choose_levels, planes_of
from scanweld.video.noise import DepthNoise, depth_noise
from scanweld.video.records import Fate, Keyframe, Log, VideoFrame
from tests.scenes import small_creature
from tests.videos import (
    CAMERA,
    KINECT,
    Video,
    along_wall,
    tracked,
    video,
    way_around,
)


def _pose_error(made: Video, found: Keyframe, reference: Keyframe) -> tuple[float, float]:
    true = made.world_from_frame[reference.name].inverse() @ made.world_from_frame[found.name]
    said = reference.piece_from_keyframe.inverse() @ found.piece_from_keyframe
    off = true.inverse() @ said
    return off.angle_deg(), float(np.linalg.norm(off.translation))


def test_keyframes_are_where_the_camera_stood():
    made = video(way_around(30, 36.0))
    found, log = tracked(made.frames)
    assert log.breaks == [] and 3 <= len(found) <= 6
    assert len(log.fates) == 30 and set(log.fates.values()) <= {Fate.KEYFRAME, Fate.AVERAGED}
    assert sum(each.num_frames for each in found) == 30
    for each in found[1:]:
        angle, shift = _pose_error(made, each, found[0])
        assert angle < 0.3 and shift < 0.006  # of a way of 0.6 m, 1 % of which is 6 mm


def test_a_thing_on_a_table_holds_a_track_that_the_table_does_not():
    mesh, middle = table_with(small_creature(), 0.2, 0.0), np.array([0.0, 0.0, 0.08])
    for seed in (1, 2):
        way = around(middle, 0.5, np.linspace(0.0, 350.0, 300), np.random.default_rng(seed))
        made = video(way[:30], mesh=mesh)
        found, log = tracked(made.frames)
        assert log.breaks == [] and sum(each.num_frames for each in found) >= 28
        for each in found[1:]:
            angle, shift = _pose_error(made, each, found[0])
            assert angle < 2.5 and shift < 0.02  # what slides on the table is off by 200 mm


def test_averaging_lowers_noise_by_the_root_of_the_number_of_frames():
    made = video(way_around(12, 8.0))
    (found,), _ = tracked(made.frames)
    truth = made.exact(found.name)
    one, mean = made.frames[0].depth - truth, found.depth - truth
    both = np.isfinite(one) & np.isfinite(mean)
    one, mean, count = one[both], mean[both], found.count[both]
    assert found.num_frames == 12 and np.median(count) >= 11
    assert _rms(mean * np.sqrt(count)) < 1.3 * _rms(one)
    assert abs(np.median(mean)) < 0.1 * _rms(one)  # and not in any one direction
    assert np.isfinite(found.depth).mean() >= np.isfinite(made.frames[0].depth).mean() - 0.01


def _rms(values: np.ndarray) -> float:
    """Of all but the farthest percent: pixels at edges see what lies a pixel beside."""
    size = np.abs(values)
    return float(np.sqrt(np.mean(size[size <= np.quantile(size, 0.99)] ** 2)))


def test_edges_and_what_moves_do_not_smear():
    made = video(way_around(12, 8.0), EXACT)
    frames = []
    for k, frame in enumerate(made.frames):  # a hand that passes, nearer than all else
        depth = np.array(frame.depth)
        depth[20:60, 10 * k : 10 * k + 30] = 0.4
        frames.append(replace(frame, depth=depth))
    (found,), _ = tracked(frames)
    truth = made.exact(found.name)
    seen = np.isfinite(found.depth)
    wrong = seen & (np.abs(found.depth - truth) > 0.03 * truth)
    assert wrong[:, 40:].mean() < 2e-3  # where the hand came to be later
    assert (seen & (np.abs(found.depth - 0.4) < 1e-3))[25:55, 5:25].mean() < 0.1  # and was at first


def test_a_jump_begins_a_new_piece_and_a_bad_frame_none():
    there = way_around(8, 6.0)
    away = way_around(8, 6.0, begin_deg=150.0)
    made = video([*there, *away])
    found, log = tracked(made.frames)
    assert [each.frame for each in log.breaks] == ["frame-008"]
    assert [each.piece for each in found] == sorted(each.piece for each in found)
    assert {each.piece for each in found} == {0, 1}
    assert log.named(Fate.LOST) == []

    bad = VideoFrame(name="bad", depth=made.frames[12].depth)
    found, log = tracked([*made.frames[:4], bad, *made.frames[4:8]])
    assert log.breaks == [] and log.named(Fate.LOST) == ["bad"]
    assert all(each.piece == 0 for each in found)


def test_frames_of_a_plane_alone_are_not_averaged_and_end_the_piece():
    found, log = tracked(video(along_wall(8, 0.005)).frames)
    assert log.named(Fate.SLIDING) == [f"frame-{k:03d}" for k in range(1, 8)]
    assert [each.num_frames for each in found] == [1]
    _, log = tracked(video([*way_around(4, 3.0), *along_wall(8, 0.005)]).frames)
    assert log.named(Fate.AVERAGED) == ["frame-001", "frame-002", "frame-003"]


def test_a_view_that_wanders_off_over_a_plane_is_not_believed():
    """From a corner, which holds the pose, along the wall until only the wall is seen."""
    places = [np.array([0.9, 1.0 - 0.06 * k, 1.2]) for k in range(30)]
    made = video(
        [
            looking(place, place + np.array([1.0, 0.3 - 0.012 * k, 0.0]))
            for k, place in enumerate(places)
        ]
    )
    found, log = tracked(made.frames)
    assert any("plane" in each.why for each in log.breaks) or log.named(Fate.SLIDING)
    for each in found:
        first = next(other for other in found if other.piece == each.piece)
        assert _pose_error(made, each, first)[1] < 0.02


def test_frames_that_fit_nowhere_leave_no_keyframe():
    rng = np.random.default_rng(0)
    frames = [
        VideoFrame(name=f"{k}", depth=rng.uniform(0.5, 4.0, size=(120, 160))) for k in range(4)
    ]
    found, log = tracked(frames)
    assert found == [] and log.named(Fate.LOST) == ["0", "1", "2", "3"]


@pytest.mark.parametrize("sensor", [KINECT, D435])
def test_noise_is_measured(sensor: DepthSensor):
    made = video(way_around(3, 2.0), sensor)
    found = depth_noise([frame.depth for frame in made.frames])
    depth = np.array([1.0, 2.0])
    steps = (sensor.quantum[0] + sensor.quantum[1] * depth**2) / np.sqrt(12)
    true = np.sqrt(sensor.noise[0] ** 2 + (sensor.noise[1] * depth**2) ** 2 + steps**2)
    assert found.at(depth) == pytest.approx(true, rel=0.3)


def test_planes_are_exact_and_cut_at_jumps():
    plane = np.array([0.3, -0.2, 0.5])  # normal over distance
    directions = CAMERA.unproject_image(np.ones((CAMERA.height, CAMERA.width)))
    depth = 1.0 / (directions @ plane)
    depth[:, 80:] *= 2.0
    found = planes_of(depth, CAMERA, DepthNoise(constant=1e-4, quadratic=0.0))
    for half, true in ((found[:, :80], plane), (found[:, 80:], plane / 2.0)):
        known = half[np.isfinite(half[..., 0])]
        assert np.allclose(known, [*true, 0.0], atol=1e-7) and len(known) > 0.99 * half[..., 0].size
    empty = planes_of(np.full((9, 9), np.nan), CAMERA, DepthNoise(constant=1e-4, quadratic=0.0))
    assert np.isnan(empty).all()


def test_small_objects_are_aligned_by_fine_images():
    assert choose_levels(1000, CAMERA).chosen() == [0]
    full = choose_levels(640 * 480, replace(CAMERA, width=640, height=480))
    assert full.chosen() == [3, 2, 1]


def test_frames_are_asked_for_one_by_one_and_give_the_same_bytes_again():
    made, asked = video(way_around(8, 20.0)), []

    def one_by_one():
        for frame in made.frames:
            asked.append(frame.name)
            yield frame

    noise = depth_noise([frame.depth for frame in made.frames[:3]])
    coming = keyframes(one_by_one(), CAMERA, noise, Log())
    first = next(coming)
    assert len(asked) < len(made.frames)
    again = [first, *coming]
    found, _ = tracked(made.frames)
    assert [each.name for each in again] == [each.name for each in found]
    for one, other in zip(found, again, strict=True):
        assert one.depth.tobytes() == other.depth.tobytes()
