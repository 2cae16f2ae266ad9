"""The camera's way before a keyframe: where each frame lies, and whether it is averaged into it."""

from enum import StrEnum

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.pose import Pose
from scanweld.video.align import Alignment, Pyramid, align, pyramid_of, target_of
from scanweld.video.average import Average
from scanweld.video.levels import choose_levels
from scanweld.video.noise import DepthNoise
from scanweld.video.records import Fate, Keyframe, VideoFrame

MIN_OVERLAP, MAX_TURN_DEG = 0.6, 12.0
"""Of a frame and its keyframe. Neighbouring keyframes then share half of what they see, those two
apart a third, far more than the search of pairs needs; and a surface that one sees at 60 degrees
the other sees at 72 at most, so that their pixels are still of like size on it."""
LOST_OVERLAP, LOST_AGREEMENT = 0.3, 0.7
"""Least overlap with the keyframe, and least share of what lies on its surface among that and what
floats before it: below, a frame lies on other surfaces than those that it shows."""
WORSE = 2.0
"""Distances to the keyframe, in units of what those of the last frames usually are, above which a
frame is blurred or badly placed, and not averaged."""
MEMORY = 15
"""Frames whose usual distances a frame's are compared with."""


class Refusal(StrEnum):
    """Why a frame does not go on a track."""

    MISFIT = "misfit"
    SLID = "slid"


class Track:
    """A piece of the camera's way, with the keyframe that it has come to.

    Args:
        frame: The first.
        camera: Of all frames.
        noise: Of single depths.
    """

    def __init__(self, frame: VideoFrame, camera: Camera, noise: DepthNoise) -> None:
        self._camera, self._noise = camera, noise
        self._piece_from_keyframe = Pose.identity()
        self._before_from_now = Pose.identity()
        self._spreads: list[float] = []
        self.first = frame.name
        self._begin(frame)

    def place(self, frame: VideoFrame) -> Alignment | Refusal:
        """Where a frame lies before the keyframe, if that can be told."""
        if self._target is None:
            return Refusal.MISFIT
        pyramid = self._pyramid(frame.depth)
        heading = self._keyframe_from_last @ self._before_from_now
        for start in (heading, self._keyframe_from_last):
            found = align(pyramid, self._target, start)
            if found.overlap >= LOST_OVERLAP and found.agreement >= LOST_AGREEMENT:
                slid = found.slide is not None and is_far(found)
                return Refusal.SLID if slid else found
        return Refusal.MISFIT

    def go_on(self, frame: VideoFrame, found: Alignment) -> Fate:
        """Go on to a frame: average it into the keyframe, unless it slides, fits badly or is far.

        Args:
            frame: The next.
            found: Where it lies. If that is too far from the keyframe, the frame is the next one.
        """
        self._before_from_now = self._keyframe_from_last.inverse() @ found.keyframe_from_frame
        self._keyframe_from_last = found.keyframe_from_frame
        if is_far(found):
            self._piece_from_keyframe = self._piece_from_keyframe @ found.keyframe_from_frame
            self._begin(frame)
            return Fate.KEYFRAME
        if found.slide is not None:
            return Fate.SLIDING
        usual = float(np.median(self._spreads)) if self._spreads else found.spread
        self._spreads = [*self._spreads[1 - MEMORY :], found.spread]
        if found.spread > WORSE * max(usual, 1.0):
            return Fate.POOR
        self._average.add(frame.depth, found.keyframe_from_frame, found.spread)
        if self._average.is_due:
            self._target = target_of(self._pyramid(self._average.depth()))
        return Fate.AVERAGED

    def keyframe(self, piece: int) -> Keyframe:
        """The keyframe as it is now, of a piece of that number."""
        return Keyframe(
            name=self._name,
            depth=self._average.depth(),
            count=self._average.count(),
            num_frames=self._average.num_frames,
            piece=piece,
            piece_from_keyframe=self._piece_from_keyframe,
        )

    def _begin(self, frame: VideoFrame) -> None:
        self._name = frame.name
        self._keyframe_from_last = Pose.identity()
        self._average = Average(frame.depth, self._camera, self._noise)
        self._levels = choose_levels(int(np.isfinite(frame.depth).sum()), self._camera)
        self._target = target_of(self._pyramid(frame.depth))

    def _pyramid(self, depth: FloatArray) -> Pyramid:
        return pyramid_of(depth, self._levels, self._noise)


def is_far(found: Alignment) -> bool:
    """Whether a frame shares so little with the keyframe that it is the next one."""
    turn_deg = found.keyframe_from_frame.angle_deg()
    return found.overlap < MIN_OVERLAP or turn_deg > MAX_TURN_DEG
