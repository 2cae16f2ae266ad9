"""Coherent point drift of pycpd, rigid, from a start pose."""

import numpy as np

from benchmarks.paper.baselines.records import Answer, ScanPair, closeness
from benchmarks.study.optional import need
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose

NUM_POINTS = 500
"""Of each scan: time and memory grow with the square."""
OUTLIERS = 0.5
"""Weight of the uniform distribution: what one scan sees and the other does not."""
MAX_ITERATIONS = 150
TOLERANCE = 1e-4


def cpd(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """Rigid CPD (Myronenko and Song 2010); its score comes of the width it ends with."""
    moving, still = pair.j.samples.points[:NUM_POINTS], pair.i.samples.points[:NUM_POINTS]
    middle = still.mean(axis=0)
    target = (still - middle) / pair.diameter
    source = (start.apply(moving) - middle) / pair.diameter
    drift = _without_scale(need("pycpd").RigidRegistration)(
        X=target, Y=source, w=OUTLIERS, max_iterations=MAX_ITERATIONS, tolerance=TOLERANCE
    )
    drift.register(callback=None)
    turn = drift.R.T  # its points are rows
    shift = pair.diameter * np.ravel(drift.t) + middle - turn @ middle
    moved = Pose(rotation=turn, translation=shift)
    return Answer(i_from_j=moved @ start, score=closeness(float(np.sqrt(drift.sigma2)), 1.0))


def _without_scale(rigid: type) -> type:
    """The library's class with the scale held at 1: scans of one object share it.

    The library estimates a scale too, and then shrinks one partial scan into the other.
    """

    class Drift(rigid):
        def update_transform(self) -> None:
            super().update_transform()
            self.s = 1.0
            self.t = _mean(self.X, self.Pt1) - _mean(self.Y, self.P1) @ self.R

        def update_variance(self) -> None:
            before = self.q
            squares = np.sum((self.X[None] - self.TY[:, None]) ** 2, axis=2)
            spread = float(np.sum(self.P * squares))
            self.q = spread / (2 * self.sigma2) + 1.5 * self.Np * np.log(self.sigma2)
            self.diff = abs(self.q - before)
            self.sigma2 = max(spread / (3 * self.Np), self.tolerance**2)

    return Drift


def _mean(points: FloatArray, weights: FloatArray) -> FloatArray:
    return weights @ points / weights.sum()
