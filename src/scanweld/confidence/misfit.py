"""Systematic misfit: what is left of two surfaces' distances when the noise is averaged out.

At the right pose the residuals of neighbouring points have nothing in common, however large the
sensor's noise is. At a wrong pose that comes close, as on an object that is nearly symmetric,
whole patches lie before or behind each other.
"""

import numpy as np

from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.matches import Matches
from scanweld.geometry.pose import Pose
from scanweld.multiview.surface_terms import SurfaceSource, surface_matches

PATCH_DIAMETERS = 0.06
"""Edge of the cells over which residuals are averaged."""
MIN_PATCH_POINTS = 6
"""Points that make a mean."""
WORST_SHARE = 0.1
"""Share of the patches that may lie farther off than what is told: poor borders, say."""
REACH_TOLERANCES = 2.0
"""Farthest match, in tolerances: what lies farther apart is for the evidence to see."""


def pair_misfit(
    i: SurfaceSource, j: SurfaceSource, i_from_j: Pose, tolerance: float, diameter: float
) -> float:
    """Systematic misfit of two scans at a pose, over the tolerance.

    Args:
        i: Surface of the first scan.
        j: Surface of the second.
        i_from_j: The pose, between the sensor frames.
        tolerance: Depth tolerance of the evidence, in the scans' unit.
        diameter: Diameter of the run.
    """
    return misfit(two_way_misfits(i, j, i_from_j, tolerance, diameter)) / tolerance


def two_way_misfits(
    i: SurfaceSource, j: SurfaceSource, i_from_j: Pose, tolerance: float, diameter: float
) -> FloatArray:
    """Mean residual (P,) of each patch of one scan on the other, both ways."""
    reach, patch = REACH_TOLERANCES * tolerance, PATCH_DIAMETERS * diameter
    return np.concatenate(
        [
            patch_means(surface_matches(i, j, i_from_j.inverse(), reach), patch),
            patch_means(surface_matches(j, i, i_from_j, reach), patch),
        ]
    )


def misfit(means: FloatArray) -> float:
    """How far patches (P,) lie off, all but the worst tenth; infinite where there are none."""
    return float(np.quantile(np.abs(means), 1.0 - WORST_SHARE)) if len(means) else float("inf")


def patch_means(matches: Matches, patch: float) -> FloatArray:
    """Mean residual (P,) of the matches in each cell of that edge that has enough."""
    cells = np.floor(matches.points / patch).astype(np.int64)
    _, cell, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    total = np.bincount(cell.ravel(), weights=matches.residuals, minlength=len(count))
    return (total / count)[count >= MIN_PATCH_POINTS]
