"""From the values of depth images to metres: how many make a metre, and which are none."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanweld.errors import ReadError
from scanweld.geometry.arrays import FloatArray

_INVALID = np.iinfo(np.uint16).max
"""What some cameras write where they saw nothing, besides 0."""
_ROTATED_BITS = 3
_SMOOTHER = 4.0
"""Factor by which steps between neighbours shrink, at least, if turning their bits is right."""
_USUAL_METERS = 10.0
"""Median depth that cameras do not reach: what passes it is in finer units."""
_METERS = (0.01, 100.0)
"""Median depths that may be meant."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DepthScale:
    """How the values of a set of images become depths.

    Attributes:
        per_meter: Values in a metre.
        is_rotated: Whether each value's lowest three bits are its highest, as in SUN3D's files.
        notes: How this was found out.
    """

    per_meter: float
    is_rotated: bool = False
    notes: tuple[str, ...] = ()

    def depth(self, values: NDArray) -> FloatArray:
        """Depths in metres (H, W), NaN where there are none."""
        plain = _rotated(values) if self.is_rotated else values
        depth = plain.astype(np.float64) / self.per_meter
        with np.errstate(invalid="ignore"):
            is_none = ~np.isfinite(depth) | (depth <= 0)
        if values.dtype.kind in "ui":
            is_none |= values == _INVALID
        depth[is_none] = np.nan
        return depth


def find_scale(
    images: Sequence[NDArray], given: float | None = None, told: tuple[float, str] | None = None
) -> DepthScale:
    """How the values of images become depths.

    Args:
        images: Some of a set, values (H, W) as they stand in their files.
        given: Values in a metre as the user says.
        told: Likewise as a file or a layout says, and which.

    Raises:
        ReadError: If the depths that come out cannot be those of a depth camera.
    """
    values = _values(images)
    is_rotated = _are_rotated(images)
    notes: tuple[str, ...] = ()
    if is_rotated:
        values = _rotated(values)
        notes = ("the lowest three bits of its depths were read as their highest (SUN3D)",)
    median = float(np.median(values)) if len(values) else np.nan
    if given is not None:
        per_meter, how = given, "--depth-scale"
    elif told is not None:
        per_meter, how = told
    else:
        per_meter, how = _by_values(values, median), "their values"
    meters = median / per_meter
    if len(values) and not _METERS[0] <= meters <= _METERS[1]:
        raise ReadError(
            f"its depths are {meters:.3g} m in the median if {per_meter:g} values are a metre "
            f"(by {how}); give --depth-scale, 1000 if they are millimetres"
        )
    notes += (f"{per_meter:g} depth values taken for a metre, by {how}; points are in metres",)
    return DepthScale(per_meter=per_meter, is_rotated=is_rotated, notes=notes)


def _values(images: Sequence[NDArray]) -> NDArray:
    """All values that are depths."""
    kept = []
    for values in images:
        with np.errstate(invalid="ignore"):
            is_depth = np.isfinite(values) & (values > 0)
        if values.dtype.kind in "ui":
            is_depth &= values != _INVALID
        kept.append(values[is_depth])
    return np.concatenate(kept) if kept else np.zeros(0)


def _by_values(values: NDArray, median: float) -> float:
    """Values in a metre: 1 for fractions, else the first usual number that gives usual depths."""
    usual = (1.0, 1000.0) if values.dtype.kind == "f" else (1000.0, 5000.0, 10_000.0)
    if values.dtype.kind != "f" and len(values) and np.gcd.reduce(np.unique(values)) == 5:
        usual = (5000.0,)  # millimetres, multiplied: TUM's habit
    return next((per for per in usual if median / per <= _USUAL_METERS), usual[-1])


def _are_rotated(images: Sequence[NDArray]) -> bool:
    """Whether neighbours are much nearer to each other with the bits of their depths turned back.

    That makes their steps an eighth, or less; in other images it makes small steps large ones.
    """
    if any(values.dtype != np.uint16 for values in images):
        return False
    plain = sum(_steps(values) for values in images)
    turned = sum(_steps(_rotated(values)) for values in images)
    return turned * _SMOOTHER < plain


def _steps(values: NDArray) -> int:
    """Sum of the steps between neighbours in rows that both have a depth."""
    both = (values[:, 1:] > 0) & (values[:, :-1] > 0)
    return int(np.abs(np.diff(values.astype(np.int64), axis=1))[both].sum())


def _rotated(values: NDArray) -> NDArray:
    return (values >> _ROTATED_BITS) | (values << (16 - _ROTATED_BITS))
