"""What became of a video's frames, in words and as JSON."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scanweld.errors import some_of
from scanweld.video.records import Fate, Keyframe, Log

WORDS = {
    Fate.SLIDING: "show so little but a plane that they slide on it, and were not averaged",
    Fate.POOR: "fit badly (blurred, or something large moved), and were not averaged",
    Fate.LOST: "fit neither the frames before nor those after them, and were left out",
}


def keyframe_note(keyframe: Keyframe) -> str:
    """What a keyframe is, for the notes of its scan."""
    seen = keyframe.count[keyframe.count > 0]
    usual = int(np.median(seen)) if len(seen) else 0
    return (
        f"keyframe of a video, piece {keyframe.piece + 1}: the mean of {keyframe.num_frames} "
        f"frames, {usual} depths in the usual pixel"
    )


def words(log: Log) -> tuple[str, ...]:
    """What users should know of a video, in sentences; nothing if all went well."""
    told = [f"the track of the camera breaks at {each.frame}: {each.why}" for each in log.breaks]
    for fate, what in WORDS.items():
        if names := log.named(fate):
            told.append(f"{len(names)} of {len(log.fates)} frames {what}: {some_of(names)}")
    return tuple(told)


def fates_json(found: Sequence[Keyframe], log: Log) -> Mapping[str, Any]:
    """The track, and what became of each frame."""
    return {
        "format": 1,
        "keyframes": {
            each.name: {
                "frames": each.num_frames,
                "piece": each.piece + 1,
                "piece_from_keyframe": each.piece_from_keyframe.matrix().tolist(),
            }
            for each in found
        },
        "breaks": [{"frame": each.frame, "why": each.why} for each in log.breaks],
        "frames": {name: fate.value for name, fate in log.fates.items()},
    }
