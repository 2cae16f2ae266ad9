"""Which pose is whose: what files of poses call scans, and what the scans are called."""

from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io.names import natural_key, stem_of
from scanweld.io.pose_formats.records import PoseEntries, printed


def match_poses(path: Path, found: PoseEntries, names: Sequence[str]) -> dict[str, Pose]:
    """The poses by scan that are sound; see ``match_all_poses``.

    Raises:
        ReadError: As there.
    """
    return match_all_poses(path, found, names)[0]


def match_all_poses(
    path: Path, found: PoseEntries, names: Sequence[str]
) -> tuple[dict[str, Pose], dict[str, ReadError]]:
    """The poses by scan; scans that the file does not name, and its poses of others, are left out.

    A path belongs to the one scan whose name is its end, without suffix. Where the format has no
    names, poses belong to the scans in natural order.

    Args:
        path: The file of poses, for messages.
        found: What it says.
        names: Of all scans.

    Returns:
        Poses by scan; and of the scans whose pose is broken, what is wrong with it.

    Raises:
        ReadError: If two poses belong to one scan, or none to any; or if without names there are
            not as many poses as scans.
    """
    if any(label is None for label, _ in found.entries):
        return _parted(_in_order(path, found, names))
    poses: dict[str, Pose | ReadError] = {}
    for label, pose in found.entries:
        name = _scan_of(str(label), names, found.are_paths)
        if name in poses:
            raise ReadError(f"{path}: two poses for scan {printed(name)}; correct the file")
        if name is not None:
            poses[name] = pose
    if not poses:
        first = printed(str(found.entries[0][0]))
        raise ReadError(
            f"{path}: none of its {len(found.entries)} poses (of {first}, ...) is of a scan given; "
            "the scans' files must be called as there"
        )
    return _parted(poses)


def _parted(
    poses: Mapping[str, Pose | ReadError],
) -> tuple[dict[str, Pose], dict[str, ReadError]]:
    """Those that are sound, and those that are not."""
    sound = {name: pose for name, pose in poses.items() if isinstance(pose, Pose)}
    return sound, {name: e for name, e in poses.items() if isinstance(e, ReadError)}


def _in_order(path: Path, found: PoseEntries, names: Sequence[str]) -> dict[str, Pose | ReadError]:
    if len(found.entries) != len(names):
        raise ReadError(
            f"{path}: {len(found.entries)} poses for {len(names)} scans, and {found.title} has no "
            "names to tell them apart; give exactly the scans it is about"
        )
    ordered = sorted(names, key=natural_key)
    return {name: pose for name, (_, pose) in zip(ordered, found.entries, strict=True)}


def _scan_of(label: str, names: Sequence[str], are_paths: bool) -> str | None:
    """The scan that is called so, if it is one and only one."""
    if label in names or not are_paths:
        return label if label in names else None
    path = PurePosixPath(label.replace("\\", "/"))
    parts = (*path.parts[:-1], stem_of(path))
    matches = [name for name in names if _is_end(parts, PurePosixPath(name).parts)]
    return matches[0] if len(matches) == 1 else None


def _is_end(one: Sequence[str], other: Sequence[str]) -> bool:
    """Whether of two paths the shorter is the end of the longer."""
    shared = min(len(one), len(other))
    return shared > 0 and one[-shared:] == other[-shared:]
