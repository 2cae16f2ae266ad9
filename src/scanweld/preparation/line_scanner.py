"""Lines of sight of a grid that no single camera explains, such as that of a line scanner.

A line scanner moves while it scans: one axis of its grid counts steps of the travel, the other
fans out from the line on which the sensor moves (linear pushbroom). Each axis by itself is then a
ratio of two affine functions of the point, with a denominator of its own.
"""

from dataclasses import dataclass

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.preparation.camera_fit import affine_fit, homogeneous_fit

MIN_GAIN = 2.0
"""Factor by which a fan of rays must fit an axis better than parallel rays to be accepted."""
MIN_FAN = 3.0
"""Least shift across the cells that the fan causes over the points' depth, in residuals of the fit:
below it the fan does not show the sensor's side."""
MIN_OBLIQUE_DEG = 10.0
"""Angle between a line of sight and the direction square to the travel above which the line is
oblique."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Sight:
    """How a grid looks at its points.

    Attributes:
        axis: (3,) unit, the line of sight at the points' centroid; points away from the sensor if
            ``has_side``, else its sign means nothing.
        right: (3,) unit, square to the axis, along which columns grow.
        pitch: Spacing of the cells on the object, in the scan's unit.
        misfit: Residual of the fits over the spread of the cells.
        has_side: Whether the grid fans out, which tells the sensor's side.
        is_oblique: Whether the axis is halfway between oblique lines of sight and the direction
            square to the travel.
    """

    axis: FloatArray
    right: FloatArray
    pitch: float
    misfit: float
    has_side: bool
    is_oblique: bool


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _AxisFit:
    """One grid axis as a function of the point, about the points' centroid.

    Attributes:
        gradient: (3,) cells per length.
        fan: (3,) gradient of the denominator, which is 1 at the centroid; it grows away from the
            line from which the axis fans out. Zero if the axis looks in parallel.
        spread: Standard deviation of the cells.
        rms: Residual in cells.
        gain: Residual of parallel sight over that of the fan.
    """

    gradient: FloatArray
    fan: FloatArray
    spread: float
    rms: float
    gain: float


def line_of_sight(points: FloatArray, pixels: FloatArray) -> Sight:
    """The direction in which a grid looks at its points (N, 3) in cells (N, 2) (column, row).

    A triangulating scanner has two lines of sight, those of the light and of the camera. If the
    grid's are oblique to the travel, they are the camera's and the sheet of light is square to the
    travel: what is neither shadowed nor hidden is best seen from halfway between.
    """
    centre = points.mean(axis=0)
    scale = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()))
    unit = (points - centre) / scale
    fits = [_fit_axis(unit, pixels[:, k]) for k in range(2)]
    sight = _unit(np.cross(fits[0].gradient, fits[1].gradient))
    fanned = max(fits, key=lambda fit: fit.gain)
    depth_fan = float(fanned.fan @ sight) * float((unit @ sight).std()) * fanned.spread
    has_side = abs(depth_fan) > MIN_FAN * fanned.rms
    is_oblique = False
    if has_side:
        sight = sight * np.sign(depth_fan)
        square = _square_to_travel(fanned, sight)
        is_oblique = bool(square @ sight < np.cos(np.radians(MIN_OBLIQUE_DEG)))
        sight = _unit(sight + square) if is_oblique else sight
    right = fits[0].gradient - (fits[0].gradient @ sight) * sight
    pitch = scale * float(np.mean([1 / np.linalg.norm(fit.gradient) for fit in fits]))
    return Sight(
        axis=sight,
        right=_unit(right),
        pitch=pitch,
        misfit=max(fit.rms / fit.spread for fit in fits),
        has_side=has_side,
        is_oblique=is_oblique,
    )


def _square_to_travel(fanned: _AxisFit, sight: FloatArray) -> FloatArray:
    """The line of sight of the fan's axis that is square to the line from which it fans out."""
    travel = _unit(np.cross(fanned.gradient, fanned.fan))
    square = _unit(np.cross(travel, fanned.gradient))
    return square * np.sign(square @ sight)


def _fit_axis(unit: FloatArray, cells: FloatArray) -> _AxisFit:
    """Fit cells (N,) = (a.x + a0) / (b.x + 1) to normalised points (N, 3)."""
    gradient, _, residuals = affine_fit(unit, cells[:, None])
    spread = float(cells.std())
    floor = 1e-9 * spread
    rms = max(float(np.sqrt((residuals**2).mean())), floor)
    parallel = _AxisFit(gradient=gradient[:, 0], fan=np.zeros(3), spread=spread, rms=rms, gain=1.0)
    values = (cells - cells.mean()) / spread
    lifted = np.column_stack([unit, np.ones(len(unit))])
    solution = homogeneous_fit(np.column_stack([lifted, -values[:, None] * lifted]))
    if solution is None:
        return parallel
    top, bottom = solution[:4] / solution[7], solution[4:] / solution[7]
    if (lifted @ bottom).min() <= 0:
        return parallel
    residuals = spread * ((lifted @ top) / (lifted @ bottom) - values)
    fan_rms = max(float(np.sqrt((residuals**2).mean())), floor)
    if rms < MIN_GAIN * fan_rms:
        return parallel
    return _AxisFit(
        gradient=spread * (top[:3] - top[3] * bottom[:3]),
        fan=bottom[:3],
        spread=spread,
        rms=fan_rms,
        gain=rms / fan_rms,
    )


def _unit(vector: FloatArray) -> FloatArray:
    return vector / np.linalg.norm(vector)
