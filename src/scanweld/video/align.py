"""Where a frame lies before a keyframe, how well it fits, and whether it could slide there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scanweld.evidence.information import information_from, observability_of
from scanweld.evidence.slippage import Slide, slippage_of
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.gauss_newton import TURN_SCALE
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.scan import principal_diameter
from scanweld.video.levels import LevelChoice, halvings, planes_of, unit_normals
from scanweld.video.match import FRONT, MIN_MATCHES, matches, settle
from scanweld.video.noise import DepthNoise

ROUNDS = 10, 5, 4
"""Rounds of matching from the coarsest image to finer ones, as in KinectFusion; the last number
holds for all finer ones."""
REACH = 0.04, 0.01
"""Share of the depth up to which pixels match, in the first round and the last: hands move a camera
by less from one frame to the next, beside where it was heading, and sensors err by up to the last,
alike in neighbouring pixels."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Pyramid:
    """A depth image, halved again and again.

    Attributes:
        images: (H, W) by the number of halvings.
        levels: Which of them frames are aligned by.
        noise: Of single depths.
    """

    images: Sequence[FloatArray]
    levels: LevelChoice
    noise: DepthNoise

    def planes(self, level: int) -> FloatArray:
        """Planes (H, W, 4) of one of the images."""
        camera, noise = self.levels.cameras[level], self.noise.halved(level)
        return planes_of(self.images[level], camera, noise)


def pyramid_of(depth: FloatArray, levels: LevelChoice, noise: DepthNoise) -> Pyramid:
    """A depth image (H, W) with as many halvings as are needed."""
    return Pyramid(images=halvings(depth, levels, noise), levels=levels, noise=noise)


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """A keyframe, for frames to be aligned to.

    Attributes:
        pyramid: Of its depth.
        planes: (H, W, 4) by the number of halvings, of those that frames are aligned by.
    """

    pyramid: Pyramid
    planes: Mapping[int, FloatArray]

    @cached_property
    def own_share(self) -> float:
        """Share of its own pixels that lie on its planes, which it does not have everywhere."""
        level = self.pyramid.levels.finest
        return _share_on(self.pyramid, level, self.planes[level], Pose.identity())

    @cached_property
    def centre(self) -> FloatArray:
        """(3,) middle of what it sees."""
        return self._points.mean(axis=0)

    @cached_property
    def diameter(self) -> float:
        """Of what it sees."""
        return principal_diameter(self._points)

    @cached_property
    def _points(self) -> FloatArray:
        level = self.pyramid.levels.coarsest
        points = self.pyramid.levels.cameras[level].unproject_image(self.pyramid.images[level])
        return points[np.isfinite(points[..., 2])]


def target_of(pyramid: Pyramid) -> Target | None:
    """What frames can be aligned to; None where too little is seen for that."""
    levels = pyramid.levels
    planes = {k: pyramid.planes(k) for k in levels.chosen()}
    if np.isfinite(planes[levels.coarsest][..., 0]).sum() < MIN_MATCHES:
        return None
    return Target(pyramid=pyramid, planes=planes)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Alignment:
    """Where a frame lies before a keyframe.

    Attributes:
        keyframe_from_frame: Its pose.
        overlap: Share of the frame's pixels that lie on the keyframe's surface, or of the
            keyframe's on the frame's: the lesser one.
        agreement: Of the frame's pixels that the keyframe looks at, and does not look past its
            surface for, the share that lie on it.
        spread: Robust standard deviation of the distances, in units of what noise explains.
        observability: Of the pose, see ``observability_of``.
        slide: The surface that slides like what both see; None if the pose is held.
    """

    keyframe_from_frame: Pose
    overlap: float
    agreement: float
    spread: float
    observability: float
    slide: Slide | None


def align(frame: Pyramid, target: Target, start: Pose, min_observability: float) -> Alignment:
    """Lay a frame onto a keyframe.

    Args:
        frame: Of the same camera and levels.
        target: The keyframe.
        start: keyframe_from_frame, about.
        min_observability: Below it a pose slides, see ``PairsConfig``.
    """
    levels = frame.levels
    row = np.concatenate([start.rotation.ravel(), start.translation])
    reaches = np.geomspace(*REACH, len(levels.chosen()) + 1)
    hits, spread = np.empty((0, 0), np.int32), np.nan
    for k, level in enumerate(levels.chosen()):
        depth = frame.images[level]
        hits = np.empty(depth.shape, np.int32)
        spread = settle(
            depth,
            target.planes[level],
            levels.cameras[level].parameters,
            row,
            frame.noise.halved(level).terms,
            np.geomspace(reaches[k], reaches[k + 1], ROUNDS[min(k, len(ROUNDS) - 1)]),
            target.centre,
            TURN_SCALE / target.diameter,
            hits,
            np.empty(depth.shape),
            np.empty(depth.shape),
        )
    pose = Pose(rotation=nearest_rotation(row[:9].reshape(3, 3)), translation=row[9:])
    num_on, num_front = int((hits >= 0).sum()), int((hits == FRONT).sum())
    seen = int(np.isfinite(frame.images[levels.finest]).sum())
    back, information = _both_ways(frame, target, pose)
    slippage = slippage_of(information, min_observability)
    return Alignment(
        keyframe_from_frame=pose,
        overlap=min(num_on / max(seen * target.own_share, 1.0), back, 1.0),
        agreement=num_on / max(num_on + num_front, 1),
        spread=float(spread),
        observability=observability_of(information),
        slide=None if slippage is None else slippage.slide,
    )


def _both_ways(frame: Pyramid, target: Target, pose: Pose) -> tuple[float, FloatArray]:
    """Share of the keyframe's pixels that lie on the frame, and the information (6, 6) of a pose.

    Both by the coarsest images, whose normals have little noise.
    """
    level, levels = frame.levels.coarsest, frame.levels
    planes = frame.planes(level)
    own = _share_on(frame, level, planes, Pose.identity())
    back = _share_on(target.pyramid, level, planes, pose.inverse()) / max(own, 1e-9)
    hits, errors = _matched(frame, level, target.planes[level], pose)
    used = (hits >= 0) & np.isfinite(planes[..., 0])
    points = levels.cameras[level].unproject_image(frame.images[level])[used]
    one = pose.turn(unit_normals(planes[used]))
    other = unit_normals(target.planes[level].reshape(-1, 4)[hits[used]])
    matched = (pose.apply(points), one, other, errors[used])
    return back, information_from([matched], target.diameter)[0]


def _share_on(source: Pyramid, level: int, planes: FloatArray, pose: Pose) -> float:
    """Share of an image's pixels that lie on planes (H, W, 4)."""
    hits, _ = _matched(source, level, planes, pose)
    return float((hits >= 0).sum() / max(int(np.isfinite(source.images[level]).sum()), 1))


def _matched(
    source: Pyramid, level: int, planes: FloatArray, pose: Pose
) -> tuple[IntArray, FloatArray]:
    """What an image's pixels (H, W) meet, moved by a pose, and how far from it they are."""
    depth, camera = source.images[level], source.levels.cameras[level].parameters
    row = np.concatenate([pose.rotation.ravel(), pose.translation])
    hits, errors = np.empty(depth.shape, np.int32), np.zeros(depth.shape)
    noise = source.noise.halved(level).terms
    matches(depth, planes, camera, row, noise, REACH[1], hits, errors, np.empty(depth.shape))
    return hits.astype(np.int64), errors
