"""What every number on the page means; docs/report.md says the same, word for word."""

from collections.abc import Mapping
from typing import NamedTuple


class Definition(NamedTuple):
    """The word on the page, and its meaning."""

    term: str
    meaning: str


DEFINITIONS: Mapping[str, Definition] = {
    "verdict": Definition(
        "verdict",
        "good, doubtful (placed, but no part of the model without --with-doubtful), unplaced, or "
        "given (its pose was given, and is not judged), and why",
    ),
    "points": Definition(
        "points",
        "finite points that were read (and kept, where the scan was thinned), and others that "
        "were left out",
    ),
    "resolution": Definition("resolution", "median distance from a point to its nearest neighbour"),
    "diameter": Definition(
        "diameter",
        "diagonal of the box along the scan's principal axes, without stray points (those beyond "
        "the 0.1 and 99.9 percentiles by more than 5 % of that range)",
    ),
    "sensor": Definition(
        "sensor", "what is known of the sensor, how it is known, and what was assumed"
    ),
    "keypoints": Definition("keypoints", "PA-HKS keypoints"),
    "edges": Definition("pairs", "names of the scans that it has an accepted pair with"),
    "scan_overlap": Definition(
        "overlap",
        "largest share of its samples that agree with one other scan of its component, at the "
        "final poses",
    ),
    "rms": Definition(
        "rms",
        "root mean square of its point-to-plane residuals after the joint refinement, robustly "
        "weighted; null if the refinement was left out",
    ),
    "score": Definition(
        "score",
        "agree - 3 * front - 1.5 * contradict - free - grazing / 5. At most 1.",
    ),
    "overlap": Definition(
        "overlap", "agree + contradict: the share of samples that lie on the other scan's surface"
    ),
    "margin": Definition(
        "margin",
        "(s1 - s2) / s1, with the scores s1 of the best pose and s2 of the best distinct one (more "
        "than 12 degrees or 6 % of the diameter away), at most 1; 1 without a rival, 0 if s1 <= 0",
    ),
    "observability": Definition(
        "observability",
        "smallest over largest eigenvalue of the information matrix, 0 if the smallest is "
        "negative; near 0 the pose can slide or turn without leaving the surface",
    ),
    "kind": Definition(
        "kind", "what the two scans alone say: good, sliding, ambiguous, contradicted or no overlap"
    ),
    "accepted": Definition(
        "accepted",
        "whether the pair agrees with the poses that were found, and is used",
    ),
    "agree": Definition(
        "agree",
        "share of samples that lie on the surface that the other sensor measured, and face the "
        "same way",
    ),
    "contradict": Definition(
        "contradict", "share of samples that lie on that surface, but face another way"
    ),
    "front": Definition(
        "front", "share of samples that lie before that surface: the sensor would have seen them"
    ),
    "occluded": Definition(
        "occluded", "share of samples that lie behind that surface: the sensor could not see them"
    ),
    "free": Definition(
        "free",
        "share of samples that lie where the sensor looked past the object, and that it would have "
        "seen",
    ),
    "unknown": Definition("unknown", "share of samples of which the sensor can say nothing"),
    "residual": Definition(
        "residual",
        "distance of a scan's point from the fused surface, along the surface's normal at the "
        "nearest vertex; points farther than 6 median edges from every vertex are off the model",
    ),
    "off_model": Definition(
        "off the model", "share of the placed scans' points that have no residual"
    ),
    "support": Definition(
        "support",
        "number of scans whose surface lies there, as model.ply says; where it does not, of scans "
        "that have points nearest to a vertex or to its neighbours",
    ),
    "thin": Definition("seen by one scan", "share of the model's area with a support of at most 1"),
    "holes": Definition(
        "open borders",
        "connected pieces of edges that only one face has: holes, and the rim of what was seen",
    ),
    "coherence": Definition(
        "contour coherence",
        "share of the predicted contour points with an observed one within 2 pixels in the image",
    ),
    "confidence": Definition("confidence", "calibrated probability that the pose is right"),
    "bound": Definition(
        "exact to",
        "its pose beside the others of its component is off by no more, at 95 %, if it is placed "
        "rightly: rotation, and translation of its centroid",
    ),
    "seconds": Definition("time", "seconds of wall time"),
    "peak_mb": Definition("memory", "the largest resident memory of the process until then"),
}
"""By the key under which the page refers to it."""
