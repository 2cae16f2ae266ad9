"""Pose errors against a reference, and which scans are right, wrong or unplaced."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from scanweld.errors import InputError
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.geometry.scan import RangeScan, principal_diameter
from scanweld.io.poses import PoseSet


class Limits(NamedTuple):
    """What is still right: degrees, and percent of the object's diameter."""

    rotation_deg: float
    translation_percent: float


RIGHT = Limits(rotation_deg=3.0, translation_percent=1.5)
"""A scan that is turned or shifted by more is wrong."""


class Standing(StrEnum):
    """Where a scan stands: close to its reference pose, placed elsewhere, or not placed."""

    RIGHT = "right"
    WRONG = "wrong"
    UNPLACED = "unplaced"


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanError:
    """How far a scan lies from its reference pose.

    Attributes:
        standing: Right, wrong or unplaced.
        rotation_deg: Angle in degrees; NaN if unplaced, or placed without a reference.
        translation: Shift of the scan's centroid in the scans' unit; NaN likewise. Of the origin
            of the scan's frame where no centroid was given.
    """

    standing: Standing
    rotation_deg: float = np.nan
    translation: float = np.nan


@dataclass(frozen=True, kw_only=True, slots=True)
class PoseErrors:
    """Errors of all scans of a run, by name.

    Attributes:
        scans: Error of every scan that has a reference pose or an estimated one.
        diameter: Of the object, in the scans' unit; None where not known. Then a scan is judged
            by its rotation alone, and translations have no percentage.
    """

    scans: Mapping[str, ScanError]
    diameter: float | None

    def count(self, standing: Standing) -> int:
        """Number of scans that stand so."""
        return sum(error.standing is standing for error in self.scans.values())

    @property
    def rotations_deg(self) -> FloatArray:
        """Rotation errors of the placed scans, in the order of their names."""
        return self._placed("rotation_deg")

    @property
    def translations(self) -> FloatArray:
        """Translation errors of the placed scans, in the scans' unit."""
        return self._placed("translation")

    @property
    def translations_percent(self) -> FloatArray:
        """Translation errors of the placed scans, in percent of the diameter; NaN without one."""
        return self.translations * (100.0 / (self.diameter or np.nan))

    def _placed(self, field: str) -> FloatArray:
        values = np.array([getattr(self.scans[name], field) for name in sorted(self.scans)])
        return values[np.isfinite(values)]


def evaluate(
    estimate: PoseSet, reference: Mapping[str, Pose], scans: Sequence[RangeScan] = ()
) -> PoseErrors:
    """Compare estimated poses with reference poses, see ``evaluate_poses``.

    Args:
        estimate: Poses of the placed scans, each component in a frame of its own.
        reference: world_from_scan that poses are held against.
        scans: The scans themselves, if at hand: then translations are taken at their centroids and
            also given in percent of the object's diameter.

    Raises:
        InputError: If the two have no scan in common.
    """
    if not scans:
        return evaluate_poses(estimate, reference)
    known = [scan for scan in scans if scan.name in reference]
    return evaluate_poses(
        estimate,
        reference,
        centroids=scan_centroids(known),
        diameter=object_diameter(known, reference),
    )


def evaluate_poses(
    estimate: PoseSet,
    reference: Mapping[str, Pose],
    *,
    centroids: Mapping[str, FloatArray] | None = None,
    diameter: float | None = None,
    limits: Limits = RIGHT,
) -> PoseErrors:
    """Compare estimated poses with reference poses.

    Each component lies in a frame of its own, so it is first moved into the reference frame, by
    the motion that takes one of its scans to that scan's reference pose: the scan for which most
    of the component's scans come out right, among several the one with the smallest mean error
    (rotation and translation as shares of what is still right).

    Args:
        estimate: Poses of the placed scans, each component in a frame of its own.
        reference: world_from_scan that poses are held against. A placed scan without one (of
            another object, say) counts as wrong.
        centroids: Point (3,) of each scan, scan frame, where its translation is taken.
        diameter: Of the object, in the scans' unit.
        limits: What is still right.

    Raises:
        InputError: If the two have no scan in common.
    """
    poses = estimate.poses
    if poses and not set(poses) & set(reference):
        raise InputError(
            f"the estimate and the reference share no scan name (such as '{min(poses)}' and "
            f"'{min(reference, default='none')}'): compare poses of the same files"
        )
    errors = {name: ScanError(standing=Standing.UNPLACED) for name in sorted(reference)}
    for component in estimate.components:
        placed = {name: poses[name] for name in component}
        known = [name for name in component if name in reference]
        errors.update({name: ScanError(standing=Standing.WRONG) for name in component})
        gauges = [reference[name] @ placed[name].inverse() for name in known]
        candidates = [
            {
                name: _scan_error(off, off.shift_at(_at(centroids, name)), diameter, limits)
                for name in known
                for off in [reference[name].inverse() @ gauge @ placed[name]]
            }
            for gauge in gauges
        ]
        if candidates:
            errors.update(min(candidates, key=lambda each: _badness(each, diameter, limits)))
    return PoseErrors(scans=errors, diameter=diameter)


def scan_centroids(scans: Iterable[RangeScan]) -> dict[str, FloatArray]:
    """Mean of each scan's points, scan frame, by name."""
    return {scan.name: scan.points.mean(axis=0) for scan in scans}


def object_diameter(scans: Iterable[RangeScan], reference: Mapping[str, Pose]) -> float:
    """Diameter of the object: of all scans' points under their reference poses.

    Raises:
        InputError: If no scan has a reference pose.
    """
    posed = [reference[s.name].apply(s.points) for s in scans if s.name in reference]
    if not posed:
        raise InputError("none of the scans has a reference pose: check their names")
    return principal_diameter(np.concatenate(posed))


def _at(centroids: Mapping[str, FloatArray] | None, name: str) -> FloatArray:
    return np.zeros(3) if centroids is None else centroids[name]


def _scan_error(off: Pose, shift: float, diameter: float | None, limits: Limits) -> ScanError:
    """What a pose that is off by a motion, and shifts the centroid by as much, is worth."""
    rotation = off.angle_deg()
    is_right = rotation <= limits.rotation_deg and (
        diameter is None or 100.0 * shift <= limits.translation_percent * diameter
    )
    standing = Standing.RIGHT if is_right else Standing.WRONG
    return ScanError(standing=standing, rotation_deg=rotation, translation=shift)


def _badness(
    errors: Mapping[str, ScanError], diameter: float | None, limits: Limits
) -> tuple[int, float]:
    """What the best gauge has least of: wrong scans, then mean error."""
    rotation = np.mean([error.rotation_deg for error in errors.values()]) / limits.rotation_deg
    translation = np.mean([error.translation for error in errors.values()])
    num_wrong = sum(error.standing is Standing.WRONG for error in errors.values())
    if diameter is None:
        return num_wrong, float(rotation)
    return num_wrong, float(rotation + 100.0 * translation / diameter / limits.translation_percent)
