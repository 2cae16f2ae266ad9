"""What users know of the scans that take part in a run, by index."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from scanweld.geometry.pose import Pose
from scanweld.graph.view_graph import Edge


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class IndexedKnowledge:
    """Facts about the scans of a run.

    Attributes:
        fixed: world_from_scan of scans that stay where they are, in the order given.
        starts: Start poses i_from_j of pairs (i, j), i < j, between sensor frames.
        together: Pairs of one object that see some of the same surface.
        apart: Pairs whose scans must not be laid onto each other.
        turntable: Whether all scans relate by turns about one axis.
    """

    fixed: Mapping[int, Pose] = field(default_factory=dict)
    starts: Mapping[Edge, Pose] = field(default_factory=dict)
    together: frozenset[Edge] = frozenset()
    apart: frozenset[Edge] = frozenset()
    turntable: bool = False

    def start_key(self, edge: Edge) -> tuple[str, ...]:
        """What the key of a pair's work says of its start pose; nothing where there is none."""
        start = self.starts.get(edge)
        return () if start is None else ("start", start.matrix().tobytes().hex())
