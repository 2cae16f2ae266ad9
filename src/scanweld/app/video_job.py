"""A video's frames to keyframes in the model's folder, which are depth images like any others."""

import io
import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from scanweld.app.json_text import json_text
from scanweld.app.video_log import fates_json, keyframe_note, words
from scanweld.cut.frames import depth_image
from scanweld.errors import InputError, ReadError
from scanweld.geometry.camera import Camera
from scanweld.geometry.scan import RangeScan
from scanweld.io import PoseSet, ScanFile, natural_key, printable, write_whole
from scanweld.io.depth.capture import DepthImages, Frame
from scanweld.io.depth.intrinsics import Intrinsics
from scanweld.io.depth.scale import DepthScale
from scanweld.reconstruction import Reconstruction
from scanweld.video.keyframes import keyframes
from scanweld.video.noise import DepthNoise, depth_noise
from scanweld.video.records import Fate, Keyframe, Log, VideoFrame
from scanweld.work.progress import NoCache, Progress, ScanRefused, StageAdvanced
from scanweld.work.stage_log import StageReport, Stages
from scanweld.work.threads import map_ahead, single_threaded_algebra

logger = logging.getLogger(__name__)

KEYFRAMES, TRACK = "keyframes", "video.json"
NUM_NOISE_FRAMES = 5
"""Frames, evenly spread, from which noise is found."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Video:
    """Depth images that are frames of a video, in the natural order of their names.

    Attributes:
        images: The frames.
    """

    images: DepthImages

    def collect(self) -> tuple[Frame, ...]:
        """The frames, each with what it needs to be read.

        Raises:
            ScanweldError: If they are no depth images that can be read, or fewer than two.
        """
        try:
            frames = self.images.collect()
        except ReadError as error:
            raise ReadError(f"--video takes depth images: {error}") from error
        if len(frames) == 1:
            raise InputError(
                f"{frames[0].path}: one frame is no video; name all of its frames, or their folder"
            )
        if any(not any(part.isdigit() for part in frame.name) for frame in frames):
            logger.warning(
                "the frames' names have no numbers: their alphabetical order is taken for that of "
                "time; number them if it is not"
            )
        return frames


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class TakenVideo:
    """What was made of a video.

    Attributes:
        files: Its keyframes.
        start: Where they stood, piece by piece, as far as the track can be believed.
        unreadable: Reason for each frame that could not be read, by name.
        reasons: What users should know of it, in sentences.
        stages: What it cost.
    """

    files: tuple[Frame, ...]
    start: PoseSet
    unreadable: Mapping[str, str]
    reasons: tuple[str, ...]
    stages: Mapping[str, StageReport]

    def told(self, result: Reconstruction) -> Reconstruction:
        """A run's result that tells of the video, too."""
        return replace(
            result,
            reasons=(*result.reasons, *self.reasons),
            stages={**self.stages, **result.stages},
        )


def take_video(
    frames: Sequence[Frame],
    folder: Path,
    workers: int,
    progress: Progress,
) -> TakenVideo:
    """Track a video, and write its keyframes and its track.

    Args:
        frames: Two at least.
        folder: Of the model, where ``keyframes`` and ``video.json`` are made.
        workers: Threads: one tracks, the others read.
        progress: Told of each frame.

    Raises:
        InputError: If the frames differ in size, or make fewer than two keyframes.
        WriteError: If the keyframes cannot be written.
    """
    stages = Stages(workers=workers, cache=NoCache(), progress=progress)
    log, found, files = Log(), list[Keyframe](), list[Frame]()
    unreadable: dict[str, str] = {}
    with stages.stage("video") as counts, single_threaded_algebra():
        camera, noise = _sensor(frames)
        read = _frames(frames, camera, workers, unreadable, progress)
        for keyframe in keyframes(read, camera, noise, log):
            files.append(_written(keyframe, frames[0], camera, folder))
            found.append(replace(keyframe, depth=np.empty((0, 0)), count=np.empty((0, 0), int)))
        counts["frames"], counts["keyframes"] = len(frames), len(found)
        counts["pieces"] = len(log.breaks) + 1
        counts |= {fate.value: len(log.named(fate)) for fate in Fate if fate is not Fate.KEYFRAME}
    _check(found, log)
    write_whole(folder / KEYFRAMES / "intrinsics.json", _intrinsics_text(camera).encode())
    write_whole(folder / TRACK, json_text(fates_json(found, log)).encode())
    pieces = [[each.name for each in found if each.piece == k] for k in range(len(log.breaks) + 1)]
    return TakenVideo(
        files=tuple(files),
        start=PoseSet(
            poses={each.name: each.piece_from_keyframe for each in found},
            components=tuple(tuple(sorted(piece, key=natural_key)) for piece in pieces),
        ),
        unreadable=unreadable,
        reasons=words(log),
        stages=stages.reports,
    )


def _sensor(frames: Sequence[Frame]) -> tuple[Camera, DepthNoise]:
    """The camera, and the noise of its depths; of some frames that can be read."""
    some = frames[:: -(-len(frames) // NUM_NOISE_FRAMES)]
    scans = [*_readable(some)] or [*islice(_readable(frames), NUM_NOISE_FRAMES)]
    if not scans:
        frames[0].read()  # says why not
    camera = scans[0].camera
    assert camera is not None
    return camera, depth_noise([depth_image(scan) for scan in scans if scan.camera == camera])


def _readable(frames: Sequence[Frame]) -> Iterator[RangeScan]:
    """Those that can be read."""
    for frame in frames:
        with suppress(ReadError):
            yield frame.read()


def _frames(
    frames: Sequence[Frame],
    camera: Camera,
    workers: int,
    unreadable: dict[str, str],
    progress: Progress,
) -> Iterator[VideoFrame]:
    """The frames that can be read, one after the other; the others' reasons are noted."""

    def read(frame: Frame) -> VideoFrame | ReadError:
        try:
            scan = frame.read()
        except ReadError as error:
            return error
        if scan.camera != camera:
            raise InputError(
                f"{frame.path}: {_size(scan.camera)}, other frames {_size(camera)}; a video is of "
                "one camera: name its frames alone"
            )
        return VideoFrame(name=frame.name, depth=depth_image(scan))

    for done, (file, frame) in enumerate(
        zip(frames, map_ahead(read, frames, workers), strict=True), start=1
    ):
        if isinstance(frame, VideoFrame):
            yield frame
        else:
            unreadable[file.name] = printable(str(frame))
            progress(ScanRefused(scan=file.name, reason=unreadable[file.name]))
        progress(StageAdvanced(stage="video", done=done, total=len(frames)))


def _size(camera: Camera | None) -> str:
    return "no camera" if camera is None else f"{camera.width} x {camera.height} pixels"


def _written(keyframe: Keyframe, frame: Frame, camera: Camera, folder: Path) -> Frame:
    """A keyframe as a file: metres in floating point, so that it can be read without loss."""
    from PIL import Image

    path = folder / KEYFRAMES / f"{keyframe.name}.tif"
    path.parent.mkdir(parents=True, exist_ok=True)
    depth = np.nan_to_num(keyframe.depth).astype(np.float32)
    buffer = io.BytesIO()
    Image.fromarray(depth).save(buffer, format="TIFF", compression="tiff_adobe_deflate")
    write_whole(path, buffer.getvalue())
    settings = replace(
        frame.settings,
        intrinsics=_intrinsics(camera),
        scale=DepthScale(per_meter=1.0, notes=(keyframe_note(keyframe),)),
        max_depth=None,
        mask=None,
    )
    return Frame(path=path, name=keyframe.name, settings=settings)


def _intrinsics(camera: Camera) -> Intrinsics:
    return Intrinsics(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        width=camera.width,
        height=camera.height,
    )


def _intrinsics_text(camera: Camera) -> str:
    """Of the keyframes, so that their folder can be read by itself."""
    keys = ("fx", "fy", "cx", "cy", "width", "height")
    return json_text({key: getattr(camera, key) for key in keys})


def _check(found: Sequence[Keyframe], log: Log) -> None:
    """Refuse what is no video of a camera that moves."""
    lost, total = len(log.named(Fate.LOST)), len(log.fates)
    if len(found) < 2 and 2 * lost > total:
        raise InputError(
            f"{lost} of {total} frames do not fit those before and after them; leave --video out "
            "if they are no video, and number their names in the order of time if they are"
        )
    if len(found) < 2:
        raise InputError(
            f"the camera hardly moved: all {total} frames show one view; leave --video out, or "
            "give --masks if it is the object that moved"
        )


def placed(files: Sequence[ScanFile], staging: Path, output: Path) -> list[ScanFile]:
    """Files as they will be, where they are now in the folder that becomes the output."""
    return [
        replace(file, path=output / file.path.relative_to(staging))
        if file.path.is_relative_to(staging)
        else file
        for file in files
    ]
