"""The pairs of a component as a network: how firmly each holds its scans, and how far it misses.

Points are many and say little of what a sensor errs by over a whole scan: bent depth leaves the
pose of a pair wrong however many they are. But a component has more pairs than its poses need, and
at the poses that suit all of them best each pair would still have its scans a little elsewhere. By
how much more than its points explain is the pairs' own error, as in the adjustment of any network
of measurements (variance components: Foerstner 1979).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import root_scalar

from scanweld.evidence.rivals import RIVAL_SHIFT_DIAMETERS
from scanweld.geometry.arrays import BoolArray, FloatArray

SMALLEST_ERROR = 1e-6
"""In diameters: less is none."""
USUAL_ERROR, USUAL_REDUNDANCY = 0.5, 12
"""Error of a pair as a rule, over the distance between surfaces that coincide, and as how much
redundancy that counts beside the network's own: as two pairs more than are needed."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairTie:
    """What the matches of a pair say of the twist of one scan beside the other.

    Twists are lengths, rotations times the lever arm.

    Attributes:
        a: Place of the first scan among the component's,
        b: and of the second.
        firmness: (6,) inverse variances of the twist along the directions.
        directions: (6, 6) columns, orthonormal.
        pull: (6,) along these: firmness times the twist that the pair alone would undo.
        by_a: (6, 6) from the twist of the first scan about its middle to that of the pair,
        by_b: and from that of the second.
    """

    a: int
    b: int
    firmness: FloatArray
    directions: FloatArray
    pull: FloatArray
    by_a: FloatArray
    by_b: FloatArray

    def kept(self, error: float) -> FloatArray:
        """(6,) share of the firmness that is left if the pair may be amiss by so much.

        A displacement of that length has a sixth of its square in each direction.
        """
        return 1.0 / (1.0 + self.firmness * error**2 / 6.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PairNetwork:
    """All pairs of a component that touch, at its poses.

    Attributes:
        ties: The pairs.
        free: (6 N, 6 N - 6) basis of the twists of all scans that do not move them as a whole.
        diameter: Of the run, in the scans' unit.
    """

    ties: Sequence[PairTie]
    free: FloatArray
    diameter: float

    def covariance(self, error: float) -> FloatArray:
        """(6 N, 6 N) of the twists of all scans, if each pair may be amiss by so much."""
        inverse, _ = self._adjusted(error)
        return self.free @ inverse @ self.free.T

    def pair_error(self, apart: float) -> float:
        """How far a pair holds a scan amiss beyond its points' errors, in the scans' unit.

        What the network shows, and what is usual: that counts more, the less is redundant.

        Args:
            apart: Distance between surfaces that coincide, in the scans' unit.
        """
        own = self._own_pair_error()
        squares = USUAL_REDUNDANCY * (USUAL_ERROR * apart) ** 2 + self.redundancy * own**2
        return float(np.sqrt(squares / (USUAL_REDUNDANCY + self.redundancy)))

    @cached_property
    def redundancy(self) -> int:
        """Directions that pairs determine, less those that the poses have."""
        known = sum(int(np.count_nonzero(self._is_known(tie))) for tie in self.ties)
        return max(known - self.free.shape[1], 0)

    def _own_pair_error(self) -> float:
        """That by which the squares of the misses come to what is redundant."""

        def excess(log_error: float) -> float:
            return self._misses(float(np.exp(log_error))) - self.redundancy

        least, most = np.log(np.array([SMALLEST_ERROR, RIVAL_SHIFT_DIAMETERS]) * self.diameter)
        if not self.redundancy or excess(least) <= 0.0:
            return 0.0
        if excess(most) >= 0.0:
            return float(np.exp(most))
        return float(np.exp(root_scalar(excess, bracket=(least, most), xtol=1e-3).root))

    def _misses(self, error: float) -> float:
        """Weighted squares by which the pairs miss the poses that suit all of them best."""
        inverse, gradient = self._adjusted(error)
        total = 0.0
        for tie in self.ties:
            known = self._is_known(tie)
            each = tie.kept(error)[known] * tie.pull[known] ** 2 / tie.firmness[known]
            total += float(each.sum())
        return total - float(gradient @ inverse @ gradient)

    def _is_known(self, tie: PairTie) -> BoolArray:
        """(6,) directions in which a pair is surer than rivals are apart."""
        return tie.firmness > 1.0 / (RIVAL_SHIFT_DIAMETERS * self.diameter) ** 2

    def _adjusted(self, error: float) -> tuple[FloatArray, FloatArray]:
        """Covariance and gradient of what is free, least squares over all pairs."""
        size = len(self.free)
        normal, gradient = np.zeros((size, size)), np.zeros(size)
        for tie in self.ties:
            kept = tie.kept(error)
            firm = (tie.directions * (tie.firmness * kept)) @ tie.directions.T
            pull = tie.directions @ (kept * tie.pull)
            a, b = (slice(6 * k, 6 * k + 6) for k in (tie.a, tie.b))
            normal[a, a] += tie.by_a.T @ firm @ tie.by_a
            normal[b, b] += tie.by_b.T @ firm @ tie.by_b
            cross = tie.by_a.T @ firm @ tie.by_b
            normal[a, b] -= cross
            normal[b, a] -= cross.T
            gradient[a] += tie.by_a.T @ pull
            gradient[b] -= tie.by_b.T @ pull
        inner = self.free.T @ normal @ self.free
        # What nothing holds may be off by a diameter.
        inner += np.eye(len(inner)) / self.diameter**2
        inverse = np.asarray(np.linalg.inv(inner), dtype=np.float64)
        return inverse, self.free.T @ gradient
