"""Adjacent views held together by their contours: one scan predicted in the camera of another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from scanweld.config import ContoursConfig
from scanweld.contours.coherence import ContourPair, contour_pair
from scanweld.contours.contour_sets import ObservedContours
from scanweld.evidence.icp import MIN_MATCHES
from scanweld.geometry.arrays import FloatArray, IntArray
from scanweld.geometry.camera import Camera
from scanweld.geometry.point_fit import num_trusted
from scanweld.geometry.pose import Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class ContourLink:
    """Scan i rendered into camera j, contours pruned.

    Attributes:
        i: The scan that is predicted.
        j: The scan that observes.
        pair: The contours of both, in the sensor frame of j at the pose they were rendered at.
        points: (N, 3) the predicted contours in the sensor frame of i, to which they belong.
        camera: Of j.
        pixel: Footprint of a pixel of j.
    """

    i: int
    j: int
    pair: ContourPair
    points: FloatArray
    camera: Camera
    pixel: float

    @property
    def holds(self) -> bool:
        """Whether there are contours enough to say anything."""
        return min(len(self.pair.predicted), len(self.pair.observed)) >= MIN_MATCHES

    @cached_property
    def predicted_tree(self) -> KDTree:
        """Of the predicted contours, in the sensor frame of i."""
        return KDTree(self.points)

    @cached_property
    def observed_tree(self) -> KDTree:
        """Of the observed contours, in the sensor frame of j."""
        return KDTree(self.pair.observed.points)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LinkMatches:
    """Matched contour points of a link.

    Attributes:
        link: The link.
        points: (N, 3) predicted points, in the sensor frame of i.
        observed: (N,) which observed points they are matched to.
    """

    link: ContourLink
    points: FloatArray
    observed: IntArray

    def __len__(self) -> int:
        return len(self.points)


def render_links(
    observed: Mapping[int, ObservedContours],
    poses: Mapping[int, Pose],
    edges: Sequence[tuple[int, int]],
    config: ContoursConfig,
) -> list[ContourLink]:
    """Both links of each edge, at the poses ``world_from_sensor``."""
    links = []
    for edge in edges:
        for i, j in (edge, edge[::-1]):
            j_from_i = poses[j].inverse() @ poses[i]
            pair = contour_pair(observed[i], observed[j], j_from_i, config)
            image = observed[j].scan.image
            points = j_from_i.inverse().apply(pair.predicted.points)
            links.append(
                ContourLink(
                    i=i, j=j, pair=pair, points=points, camera=image.camera, pixel=image.pixel
                )
            )
    return links


def match_trimmed(link: ContourLink, j_from_i: Pose, share: float | None) -> LinkMatches:
    """The closest observed point of each predicted one, the farthest matches left out.

    Trimmed ICP (Chetverikov et al. 2002) keeps a share that is given; it is found in each step
    by fractional ICP (Phillips et al. 2007) if None.
    """
    distances, nearest = link.observed_tree.query(j_from_i.apply(link.points))
    order = np.argsort(distances, kind="stable")
    squares = distances[order] ** 2
    kept = order[: num_trusted(squares, "auto" if share is None else share)]
    return LinkMatches(link=link, points=link.points[kept], observed=np.asarray(nearest)[kept])


def match_mutual(link: ContourLink, j_from_i: Pose) -> LinkMatches:
    """Pairs of a predicted and an observed point that are closest to each other."""
    _, forth = link.observed_tree.query(j_from_i.apply(link.points))
    _, back = link.predicted_tree.query(j_from_i.inverse().apply(link.pair.observed.points))
    kept = np.flatnonzero(np.asarray(back)[forth] == np.arange(len(link.points)))
    return LinkMatches(link=link, points=link.points[kept], observed=np.asarray(forth)[kept])
