"""All formats of poses: what they are called, which frames they speak of, who reads and writes."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

from scanweld.errors import ReadError
from scanweld.io.pose_formats import (
    cloudcompare,
    colmap,
    meshlab_alignment,
    meshlab_project,
    nerfstudio,
    open3d,
    stanford,
    tum,
)
from scanweld.io.pose_formats.records import Entry, Frame, PosedScan, PoseEntries
from scanweld.io.poses import read_sound_poses, read_text

KNOWN = (
    "poses.json of scanweld, Stanford .conf, MeshLab .mlp or .aln, TUM, COLMAP images.txt, Open3D "
    "PoseGraph, a folder of CloudCompare matrices, nerfstudio transforms.json"
)
"""What poses can be read from, in words."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PoseFormat:
    """A format in which poses are written and read.

    Attributes:
        title: For people.
        frame: Whether it speaks of scans or of their sensors.
        suffix: In lower case, of the files that are its own; None where others use it too.
        needs_files: Whether it names the scans' files.
        write: Texts of the files by their names, of scans in natural order.
        read: What a text says.
        recognise: Whether a text (not JSON) looks like it.
    """

    title: str
    frame: Frame
    suffix: str | None
    needs_files: bool
    write: Callable[[Sequence[PosedScan]], dict[str, str]]
    read: Callable[[Path, str], PoseEntries]
    recognise: Callable[[str], bool]


def _format(
    module: ModuleType, frame: Frame, suffix: str | None = None, *, needs_files: bool = False
) -> PoseFormat:
    return PoseFormat(
        title=module.TITLE,
        frame=frame,
        suffix=suffix,
        needs_files=needs_files,
        write=module.write,
        read=module.read,
        recognise=getattr(module, "recognise", lambda text: False),
    )


FORMATS: dict[str, PoseFormat] = {
    "conf": _format(stanford, Frame.SCAN, ".conf", needs_files=True),
    "mlp": _format(meshlab_project, Frame.SCAN, ".mlp", needs_files=True),
    "aln": _format(meshlab_alignment, Frame.SCAN, ".aln", needs_files=True),
    "tum": _format(tum, Frame.SENSOR),
    "colmap": _format(colmap, Frame.SENSOR),
    "open3d": _format(open3d, Frame.SCAN),
    "cloudcompare": _format(cloudcompare, Frame.SCAN),
    "nerfstudio": _format(nerfstudio, Frame.SENSOR),
}
"""Formats by the names that users give them."""


@np.errstate(over="ignore", invalid="ignore")  # such numbers are no rigid motion
def read_any_poses(path: Path) -> PoseEntries:
    """Read poses in any of the formats, told by content, and by suffix where that does not say.

    Args:
        path: A file; or a folder that is a scanweld or a COLMAP model, or holds CloudCompare
            matrices.

    Raises:
        ReadError: If the format is unknown or ambiguous, the file broken, or all of its poses are.
    """
    if path.is_dir():
        for name in ("poses.json", "images.txt"):
            if (path / name).is_file():
                return read_any_poses(path / name)
        return cloudcompare.read_folder(path)
    text = read_text(path)
    if text.lstrip().startswith(("{", "[")):
        return _read_json(path, text)
    found = [form for form in FORMATS.values() if form.recognise(text)]
    own = [form for form in FORMATS.values() if form.suffix == path.suffix.lower()]
    found = [form for form in found if form in own] or found or own
    if len(found) != 1:
        titles = " or ".join(form.title for form in found)
        told = f"may be {titles}" if found else "unknown format of poses"
        raise ReadError(f"{path}: {told}; scanweld reads {KNOWN}")
    return _not_empty(path, found[0].read(path, text))


def _read_json(path: Path, text: str) -> PoseEntries:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        content = None  # whoever reads it says what is wrong
    if isinstance(content, dict):
        for module in (open3d, nerfstudio):
            if module.recognise_json(content):
                return _not_empty(path, module.read(path, text))
    return _not_empty(path, _own(path))


def _own(path: Path) -> PoseEntries:
    """The largest component of scanweld's own format: others have frames of their own."""
    pose_set, broken = read_sound_poses(path)
    first = pose_set.components[0] if pose_set.components else ()
    entries: list[Entry] = [(name, pose_set.poses[name]) for name in first]
    entries += broken.items()
    return PoseEntries(title="scanweld", frame=Frame.SCAN, entries=tuple(entries), are_paths=False)


def _not_empty(path: Path, found: PoseEntries) -> PoseEntries:
    if not found.entries:
        raise ReadError(f"{path}: holds no poses ({found.title}); give a file that does")
    broken = [pose for _, pose in found.entries if isinstance(pose, ReadError)]
    if len(broken) == len(found.entries):
        raise broken[0]
    return found
