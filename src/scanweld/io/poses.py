"""Files of poses: scanweld's own JSON, and the flat ``{name: 4x4}`` of reference data."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from scanweld.errors import ReadError
from scanweld.geometry.pose import Pose
from scanweld.io.atomic import write_whole
from scanweld.io.matrices import pose_from_numbers
from scanweld.io.names import natural_key
from scanweld.io.text_encoding import plain_text

FORMAT = 1
CONVENTION = (
    "x_world = M x_scan: each 4x4 matrix, row-major, maps homogeneous column vectors in the "
    "coordinates of the scan's file to the frame of its component, in the unit of the file"
)


@dataclass(frozen=True, kw_only=True, slots=True)
class PoseSet:
    """Poses of scans by name.

    Attributes:
        poses: world_from_scan of every placed scan.
        components: Names of the scans that share a frame; each placed scan is in exactly one.
        unplaced: Name of a scan without a pose -> the reason.
    """

    poses: dict[str, Pose]
    components: tuple[tuple[str, ...], ...]
    unplaced: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        named = [name for component in self.components for name in component]
        if len(set(named)) < len(named) or set(named) != set(self.poses):
            raise ValueError("the components must name every placed scan, each once")
        if both := sorted(set(self.poses) & set(self.unplaced), key=natural_key):
            raise ValueError(f"{both[0]!r} has a pose and is named as unplaced")


def read_poses(path: Path | str) -> PoseSet:
    """Read poses in scanweld's format or as a flat ``{name: 4x4}``, taken as one component.

    Raises:
        ReadError: If the file is not such JSON, or a matrix is not a rigid motion.
    """
    pose_set, broken = read_sound_poses(Path(path))
    for error in broken.values():
        raise error
    return pose_set


def read_sound_poses(path: Path) -> tuple[PoseSet, dict[str, ReadError]]:
    """The poses that are rigid motions, and of the other scans what is wrong with theirs.

    Raises:
        ReadError: If the file is not such JSON.
    """
    content = load_json(path, read_text(path))
    try:
        if "format" not in content:
            poses, broken = _poses(path, content)
            return PoseSet(poses=poses, components=(tuple(poses),) if poses else ()), broken
        if content["format"] != FORMAT:
            raise ValueError(f"format {content['format']!r} is unknown, only {FORMAT} can be read")
        return _own_format(path, content)
    except ValueError as error:
        raise _refusal(path, error) from error


def write_poses(path: Path | str, pose_set: PoseSet) -> None:
    """Write poses in scanweld's format: the same poses give the same bytes.

    Raises:
        WriteError: If the file cannot be written.
    """
    scans = {
        name: pose_set.poses[name].matrix().tolist()
        for name in sorted(pose_set.poses, key=natural_key)
    }
    unplaced = {
        name: pose_set.unplaced[name] for name in sorted(pose_set.unplaced, key=natural_key)
    }
    entries = [
        f'"format": {FORMAT}',
        f'"convention": {_json(CONVENTION)}',
        f'"scans": {_block("{}", [f"{_json(k)}: {_matrix(m)}" for k, m in scans.items()])}',
        f'"components": {_block("[]", [_json(list(c)) for c in pose_set.components])}',
        f'"unplaced": {_block("{}", [f"{_json(k)}: {_json(v)}" for k, v in unplaced.items()])}',
    ]
    text = "{\n " + ",\n ".join(entries) + "\n}\n"
    write_whole(Path(path), text.encode("utf-8"))


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _matrix(rows: list[list[float]]) -> str:
    """A matrix with each row on a line of its own."""
    return "[\n   " + ",\n   ".join(_json(row) for row in rows) + "\n  ]"


def _block(brackets: str, items: list[str]) -> str:
    if not items:
        return brackets
    return f"{brackets[0]}\n  " + ",\n  ".join(items) + f"\n {brackets[1]}"


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, or in UTF-16 or UTF-32.

    Raises:
        ReadError: If it cannot be read, or is no such text.
    """
    try:
        text = plain_text(path, path.read_bytes()).decode()
    except OSError as error:
        raise ReadError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except UnicodeError as error:
        raise ReadError(f"{path}: is no text in UTF-8; save it so") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def load_json(path: Path, text: str) -> dict[str, Any]:
    """The JSON object in a file's text; NaN and keys that come twice are errors.

    Raises:
        ReadError: If it is none.
    """
    try:
        content = json.loads(
            text, object_pairs_hook=_without_repeats, parse_constant=_refuse_constant
        )
    except (ValueError, RecursionError) as error:
        raise ReadError(f"{path}: not valid JSON ({error}); correct or replace it") from error
    if not isinstance(content, dict):
        raise ReadError(f"{path}: not a JSON object; give another file")
    return content


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        repeated = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key {repeated!r} comes twice")
    return found


def _refuse_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number in JSON")


def _refusal(path: Path, error: ValueError) -> ReadError:
    return ReadError(f"{path}: {error}; correct the file or write it anew")


def _poses(path: Path, scans: dict[str, Any]) -> tuple[dict[str, Pose], dict[str, ReadError]]:
    """Poses by name, and what is wrong with those that are none."""
    poses: dict[str, Pose] = {}
    broken: dict[str, ReadError] = {}
    for name, rows in scans.items():
        try:
            poses[name] = _pose(name, rows)
        except ValueError as error:
            broken[name] = _refusal(path, error)
    return poses, broken


def _own_format(path: Path, content: dict[str, Any]) -> tuple[PoseSet, dict[str, ReadError]]:
    scans, unplaced = content.get("scans"), content.get("unplaced", {})
    if not isinstance(scans, dict) or not isinstance(unplaced, dict):
        raise ValueError("'scans' and 'unplaced' must be JSON objects")
    poses, broken = _poses(path, scans)
    components = content.get("components", [list(poses)] if poses else [])
    if not isinstance(components, list) or not all(_is_names(part) for part in components):
        raise ValueError("'components' must be a list of lists of names")
    sound = [tuple(name for name in part if name not in broken) for part in components]
    pose_set = PoseSet(
        poses=poses,
        components=tuple(part for k, part in enumerate(sound) if part or not components[k]),
        unplaced={name: str(reason) for name, reason in unplaced.items()},
    )
    return pose_set, broken


def _is_names(part: Any) -> bool:
    return isinstance(part, list) and all(isinstance(name, str) for name in part)


def _pose(name: str, rows: Any) -> Pose:
    is_matrix = (
        isinstance(rows, list)
        and len(rows) == 4
        and all(isinstance(row, list) and len(row) == 4 for row in rows)
        and all(type(x) in (int, float) for row in rows for x in row)
    )
    if not is_matrix:
        raise ValueError(f"{name!r} is not a 4x4 matrix of numbers")
    try:
        return pose_from_numbers([float(x) for row in rows for x in row])
    except (ValueError, OverflowError) as error:
        raise ValueError(f"{name!r}: {error}") from error
