"""frames.json: how the depth images of a run were read, so that they can be read again."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from scanweld.app.json_text import json_text
from scanweld.errors import ReadError
from scanweld.io import ScanFile, path_from, write_whole
from scanweld.io.depth.capture import Frame
from scanweld.io.depth.frame import FrameSettings
from scanweld.io.poses import load_json, read_text

FRAMES = "frames.json"
_BESIDE = ("mask", "color")
"""Settings that are paths: they are written as seen from the model's folder."""
_SETTINGS = TypeAdapter(dict[str, FrameSettings])


def write_frames(files: Sequence[ScanFile], folder: Path, final: Path) -> None:
    """Write how depth images were read; nothing where no file is one.

    Args:
        files: Of all scans.
        folder: Where to write.
        final: Where that folder will be, from which masks and colours are seen.

    Raises:
        WriteError: If the file cannot be written.
    """
    frames = {}
    for file in files:
        if isinstance(file, Frame):
            told = asdict(file.settings)
            seen = {key: path_from(final, told[key]) for key in _BESIDE if told[key] is not None}
            frames[file.name] = told | seen
    if frames:
        write_whole(folder / FRAMES, json_text(frames).encode())


def read_frames(folder: Path) -> dict[str, FrameSettings]:
    """How depth images were read, by the scans' names; empty where none were.

    Raises:
        ReadError: If the file is broken.
    """
    path = folder / FRAMES
    if not path.is_file():
        return {}
    try:
        found = _SETTINGS.validate_python(load_json(path, read_text(path)))
    except (ValidationError, ValueError) as error:
        raise ReadError(f"{path}: is broken; run scanweld again to write it anew") from error
    return {name: _placed(frame, folder) for name, frame in found.items()}


def _placed(frame: FrameSettings, folder: Path) -> FrameSettings:
    """The settings with paths as they are seen from here."""
    paths = {key: getattr(frame, key) for key in _BESIDE}
    return replace(frame, **{k: folder / path for k, path in paths.items() if path is not None})
