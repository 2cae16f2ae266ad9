"""Contour matches of a refinement: predicted contours rendered now and then, and moved between."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scanweld.contours.coherence import ContourMatcher, ContourPair
from scanweld.geometry.pose import Pose
from scanweld.refinement.least_squares import MIN_MATCHES, Found
from scanweld.work.threads import map_in_rows

NUM_INNER_ROUNDS = 2
"""Rounds for which a predicted contour is moved along with its scan before it is rendered anew: the
inner iterations of MM-ICC (paper 3.2)."""
MAX_VIEWS = 6
"""Scans that each is matched with by contours, those with most surface in common first."""


@dataclass(kw_only=True, slots=True, eq=False)
class Outlines:
    """The contours of a component's scans, matched round after round.

    Attributes:
        contours: Of all scans.
        workers: Threads.
    """

    contours: ContourMatcher
    workers: int = 1
    _rounds: int = 0
    _rendered: dict[tuple[int, int], tuple[ContourPair, Pose]] = field(default_factory=dict)

    def matches(self, poses: Mapping[int, Pose], surface: Sequence[Found]) -> list[Found]:
        """Contour matches at poses ``world_from_sensor``, given the surface matches there."""
        if self._rounds % NUM_INNER_ROUNDS == 0:
            ways = [way for i, j in _adjacent(surface) for way in ((i, j), (j, i))]
            rendered = map_in_rows(lambda way: self._render(*way, poses), ways, self.workers)
            self._rendered = dict(zip(ways, rendered, strict=True))
        self._rounds += 1
        found = map_in_rows(lambda way: self._match(*way, poses), [*self._rendered], self.workers)
        return [each for each in found if len(each[2]) >= MIN_MATCHES]

    def _render(self, i: int, j: int, poses: Mapping[int, Pose]) -> tuple[ContourPair, Pose]:
        j_from_i = poses[j].inverse() @ poses[i]
        return self.contours.pair(i, j, j_from_i), j_from_i

    def _match(self, i: int, j: int, poses: Mapping[int, Pose]) -> Found:
        pair, rendered_at = self._rendered[i, j]
        j_from_i = poses[j].inverse() @ poses[i]
        return i, j, self.contours.matches(j, pair.moved(j_from_i @ rendered_at.inverse()))


def _adjacent(surface: Sequence[Found]) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, of which at least one scan has the other among its nearest views."""
    shared: dict[tuple[int, int], int] = {}
    for i, j, matches in surface:
        edge = min(i, j), max(i, j)
        shared[edge] = shared.get(edge, 0) + len(matches)
    views: dict[int, int] = {}
    chosen = []
    for edge in sorted(shared, key=lambda edge: (-shared[edge], edge)):
        if any(views.get(k, 0) < MAX_VIEWS for k in edge):
            chosen.append(edge)
        for k in edge:
            views[k] = views.get(k, 0) + 1
    return sorted(chosen)
