"""A video to keyframes, one after the other, with never more than two of them at hand.

A frame that does not fit the keyframe waits, as the first one does. If the next one fits the
keyframe, that was a bad frame; if the next one fits the frame that waits, a new piece of the track
begins with this.
"""

import logging
from collections.abc import Iterable, Iterator

from scanweld.geometry.camera import Camera
from scanweld.video.align import Alignment
from scanweld.video.noise import DepthNoise
from scanweld.video.records import Break, Fate, Keyframe, Log, VideoFrame
from scanweld.video.track import Refusal, Track, is_far

logger = logging.getLogger(__name__)

WHY = {
    Refusal.MISFIT: "the frames before and after it do not fit each other",
    Refusal.SLID: "the camera saw too little but a plane, which slides on itself",
}


def keyframes(
    frames: Iterable[VideoFrame],
    camera: Camera,
    noise: DepthNoise,
    log: Log,
) -> Iterator[Keyframe]:
    """The keyframes of a video, each as soon as it is finished.

    Args:
        frames: In the order of time; each is asked for when the one before is done with.
        camera: Of all of them, a pinhole.
        noise: Of single depths.
        log: Filled with what becomes of the frames.
    """
    current: Track | None = None
    waiting: tuple[Track, Refusal] | None = None
    for frame in frames:
        log.fates[frame.name] = Fate.LOST  # until a place is found for it
        found = Refusal.MISFIT if current is None else current.place(frame)
        if isinstance(found, Refusal) and waiting is not None:
            track, why = waiting
            later = track.place(frame)
            if isinstance(later, Alignment):
                if current is not None:
                    yield current.keyframe(len(log.breaks))
                    log.breaks.append(Break(frame=track.first, why=WHY[why]))
                    logger.info("a new piece begins at %s: %s", track.first, WHY[why])
                log.fates[track.first] = Fate.KEYFRAME
                current, found = track, later
        if isinstance(found, Refusal) or current is None:
            waiting = Track(frame, camera, noise), Refusal(found)
            continue
        waiting = None
        if is_far(found):
            yield current.keyframe(len(log.breaks))
        log.fates[frame.name] = current.go_on(frame, found)
    if current is not None:
        yield current.keyframe(len(log.breaks))
