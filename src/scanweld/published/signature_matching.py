"""Matching of PA-HKS keypoints by their signatures (paper 3.1, eq. 1)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from scanweld.geometry.arrays import FloatArray, IntArray, frozen


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SignatureMatches:
    """Keypoints s of a scan and t of another with like signatures.

    Attributes:
        s: (M,) indices into the first scan's keypoints, ascending.
        t: (M,) indices into the second's; one keypoint may be the nearest of several.
        distances: (M,) root mean square difference of the log signatures.
    """

    s: IntArray
    t: IntArray
    distances: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "distances", frozen(self.distances, np.float64, (None,)))
        object.__setattr__(self, "s", frozen(self.s, np.int64, (len(self.distances),)))
        object.__setattr__(self, "t", frozen(self.t, np.int64, (len(self.distances),)))

    def __len__(self) -> int:
        return len(self.distances)


def signature_distances(s: FloatArray, t: FloatArray) -> FloatArray:
    """d(s, t) of eq. 1 for all pairs (K, L): root mean square difference over the times.

    Args:
        s: (K, T) log signatures.
        t: (L, T) log signatures.
    """
    return cdist(s, t) / np.sqrt(max(s.shape[1], 1))


def match_signatures(
    s: FloatArray,
    t: FloatArray,
    *,
    max_distance: float | None = None,
    quantile: float = 0.5,
    mutual: bool = False,
) -> SignatureMatches:
    """The nearest signature of T for each of S, refused above a threshold (eq. 1).

    The paper names no threshold and asks each s alone; both readings are options. Of several
    signatures equally near the first is taken.

    Args:
        s: (K, T) log signatures of the first scan.
        t: (L, T) of the second.
        max_distance: The threshold; found by the quantile if None.
        quantile: The threshold is this quantile of the distances: 0.5 is the median, 1 keeps all.
        mutual: Whether s must be the nearest of its t, too.
    """
    if len(s) == 0 or len(t) == 0:
        none = np.zeros(0, dtype=np.int64)
        return SignatureMatches(s=none, t=none, distances=np.zeros(0))
    distances = signature_distances(s, t)
    from_s, nearest = np.arange(len(s)), distances.argmin(axis=1)
    if mutual:
        from_s = from_s[distances.argmin(axis=0)[nearest] == from_s]
        nearest = nearest[from_s]
    found = distances[from_s, nearest]
    threshold = np.quantile(found, quantile) if max_distance is None else max_distance
    kept = found <= threshold
    return SignatureMatches(s=from_s[kept], t=nearest[kept], distances=found[kept])
