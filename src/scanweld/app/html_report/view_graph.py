"""The view graph as a drawing: scans on a circle, those that see the same side near each other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.app.html_report.style import STYLE
from scanweld.app.model_files import PairEntry
from scanweld.pairs.result import PairKind


@dataclass(frozen=True, kw_only=True, slots=True)
class Node:
    """A scan on the unit circle, y down; its label stands outside, turned where many are close."""

    name: str
    x: float
    y: float
    turn: float
    anchor: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Link:
    """A pair as a line; ``level`` 0 to 4 for its strength, None where it was good but refused."""

    pair: PairEntry
    x1: float
    y1: float
    x2: float
    y2: float
    level: int | None
    width: float


@dataclass(frozen=True, kw_only=True, slots=True)
class GraphDrawing:
    """Nodes and lines, weakest lines first."""

    nodes: tuple[Node, ...]
    links: tuple[Link, ...]
    is_dense: bool


def draw_graph(
    components: Sequence[Sequence[str]], unplaced: Sequence[str], pairs: Sequence[PairEntry]
) -> GraphDrawing:
    """Lay out all scans and the pairs that were accepted, or were good and yet refused."""
    accepted = [pair for pair in pairs if pair.accepted]
    groups = [round_order(component, accepted) for component in components]
    groups += [list(unplaced)] if unplaced else []
    places = _places(groups)
    nodes = tuple(_node(name, angle, len(places) > 16) for name, angle in places.items())
    thinner = min(1.0, 16 / max(len(places), 1))
    links = [
        _link(pair, places, thinner)
        for pair in pairs
        if pair.accepted or pair.kind is PairKind.GOOD
    ]
    links.sort(key=lambda link: (link.level is None, link.level or 0))
    return GraphDrawing(nodes=nodes, links=tuple(links), is_dense=len(places) > 24)


def pair_level(pair: PairEntry) -> int:
    """The step, 0 to 4, at which a pair is drawn: by its confidence, or else by its score."""
    of_score = (pair.score or 0.0) / STYLE.graph_full_score
    strength = of_score if pair.confidence is None else pair.confidence
    return int(np.clip(np.floor(strength * STYLE.graph_levels), 0, STYLE.graph_levels - 1))


def round_order(names: Sequence[str], accepted: Sequence[PairEntry]) -> list[str]:
    """The scans so that strong pairs are near each other: by angle in the Laplacian's modes."""
    if len(names) < 4:
        return list(names)
    number = {name: k for k, name in enumerate(names)}
    weights = np.full((len(names), len(names)), 1e-3)
    for pair in accepted:
        if pair.i in number and pair.j in number:
            i, j = number[pair.i], number[pair.j]
            weights[i, j] = weights[j, i] = 0.05 + max(0.0, pair.score or 0.0)
    np.fill_diagonal(weights, 0.0)
    laplacian = np.diag(weights.sum(axis=1)) - weights
    modes = np.linalg.eigh(laplacian)[1][:, 1:3]
    angle = np.round(np.arctan2(modes[:, 1], modes[:, 0]), 6)
    order = sorted(range(len(names)), key=lambda k: (angle[k], k))
    first = order.index(0)
    order = order[first:] + order[:first]
    if number[names[order[-1]]] < number[names[order[1]]]:  # either way around is as good
        order = [order[0], *reversed(order[1:])]
    return [names[k] for k in order]


def _places(groups: Sequence[Sequence[str]]) -> Mapping[str, float]:
    """Angle of each scan, clockwise from the top, with a gap of one place between groups."""
    gaps = len(groups) if len(groups) > 1 else 0
    slots = sum(map(len, groups)) + gaps
    angles, place = {}, 0
    for group in groups:
        for name in group:
            angles[name] = 2 * np.pi * place / max(slots, 1)
            place += 1
        place += 1 if gaps else 0
    return angles


def _point(angle: float) -> tuple[float, float]:
    return round(float(np.sin(angle)), 4), round(-float(np.cos(angle)), 4)


def _node(name: str, angle: float, is_turned: bool) -> Node:
    x, y = _point(angle)
    is_right = angle < np.pi - 1e-6
    is_middle = abs(np.sin(angle)) < 1e-6 and not is_turned
    turn = np.degrees(angle) - (90 if is_right else 270) if is_turned else 0.0
    anchor = "middle" if is_middle else "start" if is_right else "end"
    return Node(
        name=name,
        x=x,
        y=y,
        turn=round(float(turn), 2),
        anchor=anchor,
    )


def _link(pair: PairEntry, places: Mapping[str, float], thinner: float) -> Link:
    x1, y1 = _point(places[pair.i])
    x2, y2 = _point(places[pair.j])
    level = pair_level(pair) if pair.accepted else None
    width = 1.2 if level is None else 0.8 + 0.9 * level
    return Link(pair=pair, x1=x1, y1=y1, x2=x2, y2=y2, level=level, width=round(width * thinner, 2))
