"""Intrinsics of a depth camera: Open3D, BOP and plain JSON, numbers in text, COLMAP, ROS."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scanweld.errors import ReadError
from scanweld.io.poses import read_text

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_NAMED = re.compile(rf"\b(fx|fy|cx|cy|width|height)\s*[=:]\s*({_NUMBER.pattern})")
_LIST = r"(?:.*?data)?\s*:\s*\[([^\]]*)\]"
_MATRIX = re.compile(rf"^\s*(?:camera_matrix|K|k){_LIST}", re.MULTILINE | re.DOTALL)
_COEFFICIENTS = re.compile(rf"^\s*(?:distortion_coefficients|D|d){_LIST}", re.MULTILINE | re.DOTALL)
_APC = re.compile(rf"Color camera intrinsic matrix\s+((?:{_NUMBER.pattern}\s+){{9}})")
"""A file of the APC vision toolbox has two cameras; its depths are aligned to the colours."""
_COLMAP = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
}
"""COLMAP's camera models that are read, and their parameters."""
_TERMS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
FORMS = "Open3D's JSON, a text of fx fy cx cy (width height), COLMAP's cameras.txt or ROS's YAML"


@dataclass(frozen=True, kw_only=True, slots=True)
class Intrinsics:
    """A pinhole and its lens. Pixel centres lie at integers.

    Attributes:
        fx, fy, cx, cy: As of a ``Camera``.
        width: Columns, None where the file does not say.
        height: Rows, likewise.
        distortion: k1 k2 p1 p2 k3 k4 k5 k6 of the lens; empty if it has none.
        depth_scale: Depth values in a metre, where the file says so.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int | None = None
    height: int | None = None
    distortion: tuple[float, ...] = ()
    depth_scale: float | None = None

    def __post_init__(self) -> None:
        numbers = (self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if not (np.isfinite(numbers).all() and self.fx > 0 and self.fy > 0):
            raise ValueError("focal lengths must be positive and all numbers finite")
        if any(size is not None and size < 1 for size in (self.width, self.height)):
            raise ValueError("an image has at least one pixel")


def read_intrinsics(path: Path) -> Intrinsics:
    """The intrinsics in a file, whatever its form.

    Raises:
        ReadError: If it cannot be read, has no such form, or a lens that cannot be undone.
    """
    text = read_text(path)
    try:
        return _intrinsics(text)
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        RecursionError,
        TypeError,
        ValueError,
    ) as error:
        raise ReadError(
            f"{path}: no intrinsics that can be used ({' '.join(str(error).split())[:120]}); "
            f"--intrinsics takes {FORMS}"
        ) from error


def intrinsics_of_entry(path: Path, entry: Mapping[str, Any]) -> Intrinsics:
    """The intrinsics in a part of a JSON file, with the file's path for messages.

    Raises:
        ReadError: If it has none.
    """
    try:
        return _of_json(entry)
    except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        raise ReadError(f"{path}: no intrinsics that can be used ({error}); correct it") from error


def _intrinsics(text: str) -> Intrinsics:
    if text.lstrip().startswith("{"):
        return _of_json(json.loads(text))
    if _MATRIX.search(text):
        return _of_ros(text)
    if apc := _APC.search(text):
        return _of_matrix([float(word) for word in apc[1].split()])
    lines = [line.split("#")[0].strip() for line in text.splitlines()]
    cameras = [line.split() for line in lines if re.match(r"\d+\s+[A-Z_]{5,}\s", line)]
    if cameras:
        return _of_colmap(cameras)
    if named := dict(_NAMED.findall(text)):
        return _of_names(named)
    return _of_numbers([float(word) for word in _words(lines)])


def _words(lines: Sequence[str]) -> list[str]:
    words = [word for line in lines for word in re.split(r"[\s,;\[\]]+", line) if word]
    if not words:
        raise ValueError("no numbers in it")
    return words


def _of_json(entry: Mapping[str, Any]) -> Intrinsics:
    """Of Open3D (column after column), BOP, or with plain names."""
    entry = entry.get("intrinsic", entry)
    width, height = entry.get("width", entry.get("w")), entry.get("height", entry.get("h"))
    scale = float(entry["depth_scale"]) if "depth_scale" in entry else None
    found = []
    if "fx" in entry:
        found.append(_of_names(entry))
    for key in ("intrinsic_matrix", "camera_matrix", "K", "cam_K"):
        if key in entry:
            matrix = np.array(entry[key], dtype=float)
            is_flat_columns = matrix.shape == (9,) and matrix[2] == 0 and matrix[5] == 0
            found.append(_of_matrix(matrix.reshape(3, 3).T if is_flat_columns else matrix))
        if key == "cam_K" and key in entry and scale is not None:
            scale = 1000.0 / scale  # BOP multiplies, to millimetres
    if not found:
        raise ValueError("neither fx fy cx cy nor a matrix")
    pinholes = {(each.fx, each.fy, each.cx, each.cy) for each in found}
    if len(pinholes) > 1:
        raise ValueError("fx fy cx cy and the matrix differ")
    lens = tuple(float(term) for term in entry.get("coeffs", entry.get("distortion", ())))
    return replace(
        found[0],
        width=None if width is None else int(width),
        height=None if height is None else int(height),
        depth_scale=scale,
        distortion=_lens(lens),
    )


def _of_matrix(numbers: Any) -> Intrinsics:
    """Of a matrix (3, 3) or (4, 4), row after row."""
    values = np.asarray(numbers, dtype=float).reshape(-1)
    matrix = values.reshape(4, 4)[:3, :3] if values.size == 16 else values.reshape(3, 3)
    if matrix[1, 0] or (matrix[2] != (0, 0, 1)).any():
        raise ValueError("its matrix is not fx 0 cx, 0 fy cy, 0 0 1")
    if matrix[0, 1]:
        raise ValueError("its pixels are skewed; rectify the images")
    fx, fy, cx, cy = (float(value) for value in matrix[[0, 1, 0, 1], [0, 1, 2, 2]])
    return Intrinsics(fx=fx, fy=fy, cx=cx, cy=cy)


def _of_numbers(numbers: list[float]) -> Intrinsics:
    """Of numbers alone: fx fy cx cy, with width height behind, or a matrix."""
    if len(numbers) in (9, 16):
        return _of_matrix(numbers)
    if len(numbers) not in (4, 6):
        raise ValueError(f"{len(numbers)} numbers, not 4 (fx fy cx cy), 6, 9 or 16 (a matrix)")
    if any(size != round(size) for size in numbers[4:]):
        raise ValueError("width and height are no whole numbers; they come last")
    names = ("fx", "fy", "cx", "cy", "width", "height")
    return _of_names(dict(zip(names, numbers, strict=False)))


def _of_colmap(cameras: list[list[str]]) -> Intrinsics:
    """Of COLMAP's cameras, all of which must be the same; its pixel centres lie at halves."""
    if any(camera[1:] != cameras[0][1:] for camera in cameras):
        raise ValueError("several cameras; leave the one of the depth images")
    _, model, width, height, *numbers = cameras[0]
    if model not in _COLMAP:
        raise ValueError(f"camera model {model} cannot be undone; undistort the images")
    values = dict(zip(_COLMAP[model].split(), map(float, numbers), strict=True))
    focal = values.get("f", 0.0)
    return Intrinsics(
        fx=values.get("fx", focal),
        fy=values.get("fy", focal),
        cx=values["cx"] - 0.5,
        cy=values["cy"] - 0.5,
        width=int(width),
        height=int(height),
        distortion=_lens([values.get(term, 0.0) for term in _TERMS]),
    )


def _of_ros(text: str) -> Intrinsics:
    matrix, lens = _MATRIX.search(text), _COEFFICIENTS.search(text)
    assert matrix is not None
    found = _of_matrix([float(word) for word in _words([matrix[1]])])
    numbers = [float(word) for word in _NUMBER.findall(lens[1])] if lens else []
    model = re.search(r"distortion_model\s*:\s*[\"']?(\w+)", text)
    known = model is None or model[1] in ("plumb_bob", "rational_polynomial")
    if model is not None and not known and any(numbers):
        raise ValueError(f"lens model {model[1]} cannot be undone; rectify the images")
    width, height = (
        re.search(rf"^\s*(?:image_)?{key}\s*:\s*(\d+)", text, re.MULTILINE)
        for key in ("width", "height")
    )
    return replace(
        found,
        width=None if width is None else int(width[1]),
        height=None if height is None else int(height[1]),
        distortion=_lens(numbers) if known else (),
    )


def _lens(terms: Sequence[float]) -> tuple[float, ...]:
    """The terms k1 k2 p1 p2 k3 k4 k5 k6, or none if all are zero."""
    if len(terms) > len(_TERMS) and any(terms[len(_TERMS) :]):
        raise ValueError("its lens has more than eight terms; rectify the images")
    if not any(terms):
        return ()
    return (*terms[:8], *[0.0] * (8 - len(terms)))


def _of_names(values: Mapping[str, Any]) -> Intrinsics:
    missing = [key for key in ("fx", "fy", "cx", "cy") if key not in values]
    if missing:
        raise ValueError(f"no {' '.join(missing)}")
    return Intrinsics(
        fx=float(values["fx"]),
        fy=float(values["fy"]),
        cx=float(values["cx"]),
        cy=float(values["cy"]),
        width=int(values["width"]) if "width" in values else None,
        height=int(values["height"]) if "height" in values else None,
    )
