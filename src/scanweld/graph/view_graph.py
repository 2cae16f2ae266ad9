"""The view graph: which pairs hold, which scans they place, and why the rest stay out."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations

from scanweld.geometry.pose import Pose
from scanweld.graph.doubts import Doubts
from scanweld.pairs.result import Alternative, PairResult

Edge = tuple[int, int]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Component:
    """Scans that are placed together.

    Attributes:
        poses: component_from_sensor of each scan, the reference scan's the identity.
        reference: The best-supported scan, or one that is fixed.
        world_from_scan: Where the frame of the reference scan is fixed; the world is that frame
            if not given.
    """

    poses: Mapping[int, Pose]
    reference: int
    world_from_scan: Pose | None = None

    def world_from_reference(self, scan_from_sensor: Pose) -> Pose:
        """Pose of the reference's sensor in the world, from that in its scan's frame."""
        fixed = self.world_from_scan
        return scan_from_sensor if fixed is None else fixed @ scan_from_sensor


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ViewGraph:
    """Pairs that agree with each other, and the components they make.

    Attributes:
        pairs: Results of all pairs (i, j), i < j, as the search found them.
        usable: The same as users' facts let them be used: those the graph was built from.
        accepted: The alternative of each pair that agrees with the poses.
        rejected: Why the other pairs are not used.
        components: Of at least two scans, largest first.
        unplaced: Why the other scans are in none.
        doubts: What speaks against a placed scan's final pose.
        rms: Point-to-plane residual of each placed scan after the joint refinement.
        remarks: Of accepted pairs that are believed for what is given beforehand.
    """

    pairs: Mapping[Edge, PairResult]
    usable: Mapping[Edge, PairResult]
    accepted: Mapping[Edge, Alternative]
    rejected: Mapping[Edge, str]
    components: tuple[Component, ...]
    unplaced: Mapping[int, str]
    doubts: Doubts = field(default_factory=dict)
    rms: Mapping[int, float] = field(default_factory=dict)
    remarks: Mapping[Edge, str] = field(default_factory=dict)

    def compared(self, component: Component) -> list[Edge]:
        """Pairs (i, j), i < j, of a component's scans of which something was asked, in order."""
        inside = combinations(sorted(component.poses), 2)
        return [e for e in inside if e not in self.pairs or self.pairs[e].is_compared]

    def neighbours(self, scan: int) -> tuple[int, ...]:
        """Scans that share an accepted pair with one, in order."""
        return tuple(sorted({i + j - scan for i, j in self.accepted if scan in (i, j)}))
