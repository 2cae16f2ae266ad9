"""What became of users' knowledge: each fact against the evidence, in a sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scanweld.errors import some_of
from scanweld.evidence.evidence import MIN_AGREE
from scanweld.evidence.judge import Judge
from scanweld.evidence.rivals import RIVAL_ANGLE_DEG, RIVAL_SHIFT_DIAMETERS
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.graph.view_graph import Component, Edge, ViewGraph
from scanweld.io import natural_key
from scanweld.knowledge.facts import Knowledge
from scanweld.knowledge.turntable import RULE, Turntable, turning_pairs
from scanweld.pairs.result import PairKind
from scanweld.reconstruction import FactReport, FactVerdict


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Registered:
    """The scans as they were registered: what facts are checked against.

    Attributes:
        prepared: The scans that took part.
        graph: The view graph, refined.
        judge: Gives the evidence on any pair at any pose.
        turntable: The common axis that was found, if it was looked for.
    """

    prepared: Sequence[PreparedScan]
    graph: ViewGraph
    judge: Judge
    turntable: Turntable | None

    def index(self, name: str) -> int | None:
        """Index of a scan that took part."""
        return next((k for k, scan in enumerate(self.prepared) if scan.name == name), None)

    def home(self, k: int) -> Component | None:
        """The component that holds a scan."""
        return next((c for c in self.graph.components if k in c.poses), None)

    def world_from_scan(self, k: int, home: Component) -> Pose:
        """Pose of a placed scan in the world of its component."""
        to_world = home.world_from_reference(self.prepared[home.reference].scan_from_sensor)
        return to_world @ home.poses[k] @ self.prepared[k].scan_from_sensor.inverse()

    def off(self, k: int, found: Pose, said: Pose) -> tuple[float, float]:
        """Angle and shift, in degrees and diameters, between two poses of a scan."""
        apart = said.inverse() @ found
        middle = self.prepared[k].scan_from_sensor.apply(self.judge.centres[k])
        return apart.angle_deg(), apart.shift_at(middle) / self.judge.diameter

    def is_off(self, k: int, found: Pose, said: Pose) -> bool:
        """Whether two poses of a scan are distinct answers."""
        angle, shift = self.off(k, found, said)
        return angle >= RIVAL_ANGLE_DEG or shift >= RIVAL_SHIFT_DIAMETERS


def check_facts(knowledge: Knowledge, registered: Registered) -> tuple[FactReport, ...]:
    """Every fact that was given, and how it stands against what was found.

    Args:
        knowledge: The facts.
        registered: What was found.
    """
    facts = [_fixed(name, knowledge, registered) for name in knowledge.fix]
    if knowledge.start is not None:
        facts.append(_start(knowledge, registered))
    facts += [_together(pair, registered) for pair in knowledge.together]
    facts += [_apart(pair, registered) for pair in knowledge.apart]
    if knowledge.turntable:
        facts.append(_turntable(registered))
    return tuple(facts)


def _fixed(name: str, knowledge: Knowledge, registered: Registered) -> FactReport:
    fact = f"fix {name}"
    k = registered.index(name)
    home = None if k is None else registered.home(k)
    if k is None or home is None:
        return FactReport(fact=fact, verdict=FactVerdict.OPEN, reason=f"{name} is not placed")
    start = knowledge.start.poses if knowledge.start is not None else {}
    said = start.get(name, Pose.identity())
    stays = "stays at its start pose" if name in start else "its frame is the world"
    if k == home.reference:
        return FactReport(fact=fact, verdict=FactVerdict.HELD, reason=f"{name}: {stays}")
    found = registered.world_from_scan(k, home)
    other = registered.prepared[home.reference].name
    told = f"{name} is {_apart_words(*registered.off(k, found, said))} where it should stay"
    if registered.is_off(k, found, said):
        return FactReport(
            fact=fact,
            verdict=FactVerdict.CONTRADICTED,
            reason=f"{told}, with {other} held, which the scans tie it to",
        )
    return FactReport(fact=fact, verdict=FactVerdict.HELD, reason=f"{told}, with {other} held")


def _apart_words(angle_deg: float, shift_diameters: float) -> str:
    return f"{angle_deg:.1f} deg and {shift_diameters:.1%} of the diameter from"


def _start(knowledge: Knowledge, registered: Registered) -> FactReport:
    """Start poses within each component of the file and of the run; the majority is the truth."""
    assert knowledge.start is not None
    said = knowledge.start.poses
    confirmed, wrong = set[int](), dict[int, tuple[float, float]]()
    for group in knowledge.start.components:
        for home in registered.graph.components:
            there = [k for k in sorted(home.poses) if registered.prepared[k].name in group]
            if len(there) > 1:
                off = _disagreeing(there, home, said, registered)
                wrong.update(off)
                confirmed.update(set(there) - set(off))
    named = [k for k, scan in enumerate(registered.prepared) if scan.name in said]
    left = [k for k in named if k not in confirmed and k not in wrong]
    told = [f"{len(confirmed)} of {len(named)} start poses are borne out by the scans"]
    names = {k: registered.prepared[k].name for k in named}
    if wrong:
        listed = [f"{names[k]} is {_apart_words(*wrong[k])} it" for k in _by_name(wrong, names)]
        told.append(_listed("wrong", listed))
    if left:
        told.append(_listed("not confirmed", [names[k] for k in _by_name(left, names)]))
    verdict = FactVerdict.CONTRADICTED if wrong else FactVerdict.OPEN if left else FactVerdict.HELD
    return FactReport(fact="start poses", verdict=verdict, reason="; ".join(told))


def _disagreeing(
    there: Sequence[int], home: Component, said: Mapping[str, Pose], registered: Registered
) -> dict[int, tuple[float, float]]:
    """How far start poses are off, laid onto the component by the scan that most others suit."""
    starts = {k: said[registered.prepared[k].name] for k in there}
    found = {k: registered.world_from_scan(k, home) for k in there}
    best: dict[int, tuple[float, float]] | None = None
    for anchor in sorted(there, key=lambda k: (k != home.reference, registered.prepared[k].name)):
        moved = found[anchor] @ starts[anchor].inverse()
        off = {
            k: registered.off(k, found[k], moved @ starts[k])
            for k in there
            if registered.is_off(k, found[k], moved @ starts[k])
        }
        if best is None or len(off) < len(best):
            best = off
    return best or {}


def _by_name(scans: Sequence[int] | Mapping[int, object], names: Mapping[int, str]) -> list[int]:
    return sorted(scans, key=lambda k: natural_key(names[k]))


def _listed(what: str, items: Sequence[str]) -> str:
    return f"{what}: {some_of(items)}"


def _edge(pair: tuple[str, str], registered: Registered) -> Edge | None:
    i, j = (registered.index(name) for name in pair)
    return None if i is None or j is None else (min(i, j), max(i, j))


def _shared(edge: Edge, registered: Registered) -> float | None:
    """Share of two scans' samples that agree at the final poses; None if not placed together."""
    i, j = edge
    home = registered.home(i)
    if home is None or j not in home.poses:
        return None
    return registered.judge.pair(i, j, home.poses[i].inverse() @ home.poses[j]).agree


def _together(pair: tuple[str, str], registered: Registered) -> FactReport:
    fact, edge = f"together {pair[0]} {pair[1]}", _edge(pair, registered)
    if edge is None:
        return FactReport(fact=fact, verdict=FactVerdict.OPEN, reason=_no_part(pair, registered))
    result, shared = registered.graph.pairs[edge], _shared(edge, registered)
    told = f"{pair[0]} and {pair[1]}"
    if shared is None:
        refused = result.kind is PairKind.CONTRADICTED
        return FactReport(
            fact=fact,
            verdict=FactVerdict.CONTRADICTED if refused else FactVerdict.OPEN,
            reason=f"{told} could not be placed together: {_why(edge, registered)}",
        )
    seen = f"{told} are placed, and {shared:.0%} of their surfaces agree"
    verdict = FactVerdict.HELD if shared >= MIN_AGREE else FactVerdict.CONTRADICTED
    return FactReport(fact=fact, verdict=verdict, reason=seen)


def _why(edge: Edge, registered: Registered) -> str:
    return (
        registered.graph.rejected.get(edge) or "they are placed by other scans, in two components"
    )


def _no_part(pair: tuple[str, str], registered: Registered) -> str:
    missing = next(name for name in pair if registered.index(name) is None)
    return f"{missing} takes no part"


def _apart(pair: tuple[str, str], registered: Registered) -> FactReport:
    fact, edge = f"apart {pair[0]} {pair[1]}", _edge(pair, registered)
    if edge is None:
        return FactReport(fact=fact, verdict=FactVerdict.HELD, reason=_no_part(pair, registered))
    result, shared = registered.graph.pairs[edge], _shared(edge, registered) or 0.0
    told = f"{pair[0]} and {pair[1]}"
    if shared >= MIN_AGREE:
        reason = f"{told}: {shared:.0%} of their surfaces agree where other scans place them"
        return FactReport(fact=fact, verdict=FactVerdict.CONTRADICTED, reason=reason)
    if result.kind is PairKind.GOOD and result.best is not None:
        reason = f"{told} make a good pair (score {result.best.score:.2f}), which was not used"
        return FactReport(fact=fact, verdict=FactVerdict.CONTRADICTED, reason=reason)
    return FactReport(fact=fact, verdict=FactVerdict.HELD, reason=f"{told} are not laid together")


def _turntable(registered: Registered) -> FactReport:
    table, good = registered.turntable, turning_pairs(registered.graph.pairs)
    if table is None:
        few = len({k for edge in good for k in edge}) < RULE.min_scans
        return FactReport(
            fact="turntable",
            verdict=FactVerdict.OPEN if few else FactVerdict.CONTRADICTED,
            reason=f"{len(good)} good pairs turn, and no axis is common to most of their scans",
        )
    share = table.shift / registered.judge.diameter
    told = (
        f"{len(table.edges)} good pairs turn about one axis to within {table.angle_deg:.2f} deg "
        f"and {share:.2%} of the diameter"
    )
    off = {
        edge: result.best.i_from_j
        for edge, result in sorted(registered.graph.pairs.items())
        if result.kind is PairKind.GOOD
        and result.best is not None
        and not table.allows(edge, result.best.i_from_j)
    }
    if not off:
        return FactReport(fact="turntable", verdict=FactVerdict.HELD, reason=told)
    names = [scan.name for scan in registered.prepared]
    listed = [
        f"{names[i]} - {names[j]} ({table.off_axis_words((i, j), pose)})"
        for (i, j), pose in off.items()
    ]
    return FactReport(
        fact="turntable",
        verdict=FactVerdict.CONTRADICTED,
        reason=f"{told}; {_listed('good pairs that do not', sorted(listed, key=natural_key))}",
    )
