"""What goes into a track and what comes out of it."""

from dataclasses import dataclass, field
from enum import StrEnum

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.video.average import Counts


class Fate(StrEnum):
    """What became of a frame."""

    KEYFRAME = "keyframe"
    AVERAGED = "averaged"
    SLIDING = "sliding"
    POOR = "poor"
    LOST = "lost"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class VideoFrame:
    """A frame of a video.

    Attributes:
        name: Of its scan.
        depth: (H, W) in metres, NaN for none.
    """

    name: str
    depth: FloatArray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Keyframe:
    """A view, averaged over frames.

    Attributes:
        name: Of the frame whose view it is.
        depth: (H, W), NaN for none.
        count: (H, W) measurements that each depth is the mean of.
        num_frames: Frames that were averaged.
        piece: Number of the piece of the track, from 0.
        piece_from_keyframe: Where it stood, in the frame of its piece's first keyframe.
    """

    name: str
    depth: FloatArray
    count: Counts
    num_frames: int
    piece: int
    piece_from_keyframe: Pose


@dataclass(frozen=True, kw_only=True, slots=True)
class Break:
    """Where a piece of the track ends and another begins.

    Attributes:
        frame: Name of the first frame of the next piece.
        why: What happened there, in words.
    """

    frame: str
    why: str


@dataclass(kw_only=True, slots=True)
class Log:
    """What became of a video's frames.

    Attributes:
        fates: Of each frame, by name, in their order.
        breaks: Of the track.
    """

    fates: dict[str, Fate] = field(default_factory=dict)
    breaks: list[Break] = field(default_factory=list)

    def named(self, fate: Fate) -> list[str]:
        """The frames that met it."""
        return [name for name, each in self.fates.items() if each is fate]
