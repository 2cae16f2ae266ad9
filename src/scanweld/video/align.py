"""Where a frame lies before a keyframe, how well it fits, and whether it could slide there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scanweld.evidence.information import information_from
from scanweld.evidence.slippage import Slide, slippage_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.gauss_newton import DAMPING, MAD_TO_SIGMA, SIGNIFICANT_SIGMAS, TURN_SCALE
from scanweld.geometry.pose import Pose, nearest_rotation
from scanweld.geometry.scan import principal_diameter
from scanweld.video.levels import LevelChoice, halvings, planes_of, unit_normals
from scanweld.video.match import FRONT, LEAST_SPREAD, MIN_MATCHES, matches, settle
from scanweld.video.noise import DepthNoise

ROUNDS = 10, 5, 6
"""Rounds of matching from the coarsest image to finer ones, about as in KinectFusion; the last
number holds for all finer ones."""
REACH = 0.04, 0.01
"""Share of the depth up to which pixels match, in the first round and the last: hands move a camera
by less from one frame to the next, beside where it was heading, and sensors err by up to the last,
alike in neighbouring pixels."""
HELD = 1e-3
"""Damping in coarse images, relative to the mean diagonal: small things that hold a pose are not
seen in them, and what slides without these would wander off. Finer images set the rest right."""
MAX_NORMALS = 10_000
"""Matches whose normals are asked how firmly they hold a pose, about."""


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


class Matches(NamedTuple):
    """What a frame's pixels (H, W) meet on a keyframe, see ``match.matches``."""

    hits: NDArray[np.int32]
    errors: FloatArray
    sigmas: FloatArray


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
        slide: The surface that slides like what both see, if the pose may be off by a pixel for
            that; None if it is held.
    """

    keyframe_from_frame: Pose
    overlap: float
    agreement: float
    spread: float
    slide: Slide | None


def align(frame: Pyramid, target: Target, start: Pose) -> Alignment:
    """Lay a frame onto a keyframe.

    Args:
        frame: Of the same camera and levels.
        target: The keyframe.
        start: keyframe_from_frame, about.
    """
    levels = frame.levels
    row = np.concatenate([start.rotation.ravel(), start.translation])
    reaches = np.geomspace(*REACH, len(levels.chosen()) + 1)
    found = Matches(*(np.empty((0, 0), kind) for kind in (np.int32, float, float)))
    spread = np.nan
    for k, level in enumerate(levels.chosen()):
        depth = frame.images[level]
        found = Matches(*(np.zeros(depth.shape, kind) for kind in (np.int32, float, float)))
        reach = np.geomspace(reaches[k], reaches[k + 1], ROUNDS[min(k, len(ROUNDS) - 1)])
        spread = settle(
            depth,
            target.planes[level],
            levels.cameras[level].parameters,
            row,
            frame.noise.halved(level).terms,
            reach,
            _widths(reach, level == levels.finest),
            target.centre,
            TURN_SCALE / target.diameter,
            DAMPING if level == levels.finest else HELD,
            *found,
        )
    pose = Pose(rotation=nearest_rotation(row[:9].reshape(3, 3)), translation=row[9:])
    num_on, num_front = int((found.hits >= 0).sum()), int((found.hits == FRONT).sum())
    seen = int(np.isfinite(frame.images[levels.finest]).sum())
    overlap = min(num_on / max(seen * target.own_share, 1.0), _share_back(frame, target, pose), 1.0)
    return Alignment(
        keyframe_from_frame=pose,
        overlap=overlap,
        agreement=num_on / max(num_on + num_front, 1),
        spread=float(spread),
        slide=_slide(frame, target, pose, found) if overlap > 0 else None,
    )


def _widths(reaches: FloatArray, is_finest: bool) -> FloatArray:
    """How far errors may be, besides noise, to count in each round: nothing in the last ones."""
    return reaches * np.maximum(np.linspace(1.0, -1.0 if is_finest else 1.0, len(reaches)), 0.0)


def _share_back(frame: Pyramid, target: Target, pose: Pose) -> float:
    """Share of the keyframe's pixels that lie on the frame, by the coarsest images."""
    level = frame.levels.coarsest
    planes = frame.planes(level)
    own = _share_on(frame, level, planes, Pose.identity())
    return _share_on(target.pyramid, level, planes, pose.inverse()) / max(own, 1e-9)


def _slide(frame: Pyramid, target: Target, pose: Pose, found: Matches) -> Slide | None:
    """What a frame slides like if its pose may be off by a pixel for that, by the finest images.

    Along a motion of which each of n matches has the information i, a pose has the standard
    deviation s / sqrt(i n), where s is that of a match.
    """
    level = frame.levels.finest
    camera, depth = frame.levels.cameras[level], frame.images[level]
    planes, on = frame.planes(level), found.hits >= 0
    used = on & np.isfinite(planes[..., 0])
    step = max(1, int(np.sqrt(used.sum() / MAX_NORMALS)))
    used[np.arange(len(used)) % step > 0] = False
    used[:, np.arange(used.shape[1]) % step > 0] = False
    points = pose.apply(camera.unproject_image(depth)[used])
    one = pose.turn(unit_normals(planes[used]))
    other = unit_normals(target.planes[level].reshape(-1, 4)[found.hits[used]])
    matched = (points, one, other, found.errors[used])
    information, _, count = information_from([matched], target.diameter)
    if count < MIN_MATCHES:
        return Slide.MANY
    pixel = camera.footprint(float(np.median(depth[on])))
    deviation = float(np.sqrt(np.median(found.errors[on] ** 2))) * MAD_TO_SIGMA
    deviation = max(deviation, LEAST_SPREAD * float(np.median(found.sigmas[on])))
    needed = (SIGNIFICANT_SIGMAS * deviation / pixel) ** 2 / on.sum()
    largest = max(float(np.linalg.eigvalsh(information)[-1]), np.finfo(float).tiny)
    slippage = slippage_of(information, needed / largest)
    return None if slippage is None else slippage.slide


def _share_on(source: Pyramid, level: int, planes: FloatArray, pose: Pose) -> float:
    """Share of an image's pixels, moved by a pose, that lie on planes (H, W, 4)."""
    depth, camera = source.images[level], source.levels.cameras[level].parameters
    row = np.concatenate([pose.rotation.ravel(), pose.translation])
    hits, noise = np.empty(depth.shape, np.int32), source.noise.halved(level).terms
    errors, sigmas = np.empty(depth.shape), np.empty(depth.shape)
    matches(depth, planes, camera, row, noise, REACH[1], hits, errors, sigmas)
    return float((hits >= 0).sum() / max(int(np.isfinite(depth).sum()), 1))
