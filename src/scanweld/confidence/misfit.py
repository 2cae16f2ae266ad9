"""Systematic misfit: what is left of two surfaces' distances when the noise is averaged out.

At the right pose the residuals of neighbouring points have nothing in common, however large the
sensor's noise is. At a wrong pose that comes close, as on an object that is nearly symmetric,
whole patches lie before or behind each other.
"""

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.buckets import cells_of
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose
from scanweld.refinement.surface_terms import SurfaceSource, surface_matches
from scanweld.sensor.learn import PATCH_DIAMETERS

MIN_PATCH_POINTS = 6
"""Points that make a mean."""
SURE_DEVIATIONS = 2.0
"""Standard deviations of its mean that are taken off how far a patch lies off: noise explains so
much."""
WORST_SHARE = 0.1
"""Share of the patches that may lie farther off than what is told: poor borders, say."""
REACH_TOLERANCES = 2.0
"""Farthest match, in tolerances: what lies farther apart is for the evidence to see."""


def pair_misfit(
    i: SurfaceSource, j: SurfaceSource, i_from_j: Pose, tolerance: float, diameter: float
) -> float:
    """Systematic misfit of two scans at a pose, in the scans' unit.

    Args:
        i: Surface of the first scan.
        j: Surface of the second.
        i_from_j: The pose, between the sensor frames.
        tolerance: Depth tolerance of the evidence, in the scans' unit.
        diameter: Diameter of the run.
    """
    return misfit(two_way_offsets(i, j, i_from_j, tolerance, diameter))


def two_way_offsets(
    i: SurfaceSource, j: SurfaceSource, i_from_j: Pose, tolerance: float, diameter: float
) -> FloatArray:
    """How far each patch of one scan surely lies off the other, (P,), both ways."""
    reach, patch = REACH_TOLERANCES * tolerance, PATCH_DIAMETERS * diameter
    return np.concatenate(
        [
            sure_offsets(surface_matches(i, j, i_from_j.inverse(), reach), patch),
            sure_offsets(surface_matches(j, i, i_from_j, reach), patch),
        ]
    )


def misfit(offsets: FloatArray) -> float:
    """How far patches (P,) lie off, all but the worst tenth; infinite where there are none."""
    return float(np.quantile(offsets, 1.0 - WORST_SHARE)) if len(offsets) else float("inf")


def sure_offsets(matches: Matches, patch: float) -> FloatArray:
    """Mean distance (P,) of the matches in each cell of that edge, less what noise explains.

    The noise is that within cells, of all of them together. Cells with few matches are left out.
    """
    if not len(matches):
        return np.zeros(0)
    cell, count = cells_of(matches.points, patch)
    mean = np.bincount(cell, weights=matches.residuals) / count
    within = float(((matches.residuals - mean[cell]) ** 2).sum())
    noise = np.sqrt(within / max(len(cell) - len(count), 1) / count)
    sure = np.maximum(np.abs(mean) - SURE_DEVIATIONS * noise, 0.0)
    return sure[count >= MIN_PATCH_POINTS]
