"""The loop that M-ICC and MM-ICC share: render, prune, match, solve for all views, again."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scanweld.config import ContoursConfig
from scanweld.contours.coherence import LAST_MATCH_PIXELS, OUTLINE_NOISE_PIXELS, coherence
from scanweld.contours.contour_sets import ObservedContours, observe_contours
from scanweld.geometry.gauss_newton import lever_arm, spread_of, tukey_weights
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.published.contour_links import (
    MIN_MATCHES,
    ContourLink,
    LinkMatches,
    match_mutual,
    match_trimmed,
    render_links,
)
from scanweld.published.joint_solve import Pulls, gauss_newton_step, levenberg_marquardt
from scanweld.published.residuals import image_pulls, outline_pulls, point_pulls

logger = logging.getLogger(__name__)

FIRST_MATCH_PIXELS = 16.0
"""Farthest match in the first of the rounds across the outline; it shrinks from there."""
NUM_OUTLINE_ROUNDS = 10
"""Renderings of the rounds across the outline."""
CONVERGED_PIXELS = 0.05
"""The iteration has come to rest when a rendering moves no scan by more."""
LAST_PHASE = 4
"""One in so many renderings is left for the distance in the image, where that in space is first,"""
LAST_TRIM = 0.7
"""and so large a share of the matches: near the end what does not match is told more easily."""
NUM_PROBES = 100
"""Vertices of a scan whose movement is looked at."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ContourAlignment:
    """Views aligned by contours.

    Attributes:
        poses: ``world_from_sensor``; the first scan of each connected part of the edges stays.
        rms: Distance of the matches kept, in footprints of a pixel.
        num_matches: Contour matches kept, all edges and both directions.
        converged: Whether the iteration came to rest before its last rendering.
        coherence: Share of the pruned predicted contours within 2 pixels of an observed one.
        loose: Scans that too few contours hold to the first scan of their part.
    """

    poses: Mapping[int, Pose]
    rms: float
    num_matches: int
    converged: bool
    coherence: float
    loose: tuple[int, ...]


def align_contours(
    scans: Sequence[PreparedScan],
    poses: Mapping[int, Pose],
    edges: Sequence[tuple[int, int]],
    config: ContoursConfig,
) -> ContourAlignment:
    """Align views by the coherence of their contours, all edges together.

    In an outer loop each scan is rendered into the cameras of its neighbours and the contours are
    pruned; in an inner one they are matched in 3D, and all poses are solved for at once.

    Args:
        scans: All scans.
        poses: ``world_from_sensor`` at the start, of every scan that an edge names.
        edges: Adjacent views, as indices of scans.
        config: The readings of the paper, and what it leaves open.

    Raises:
        ValueError: If an edge names a scan without a pose, or one scan twice.
    """
    _check(edges, poses)
    observed = {
        k: observe_contours(scans[k], config) for k in sorted({k for e in edges for k in e})
    }
    current, converged = dict(sorted(poses.items())), False
    for phase in _phases(config):
        current, converged = _until_still(observed, current, edges, phase)
    if config.residual == "normal":
        current = _outline_rounds(observed, current, edges, config)
    return _judged(observed, current, edges, converged, _phases(config)[-1])


def _check(edges: Sequence[tuple[int, int]], poses: Mapping[int, Pose]) -> None:
    for i, j in edges:
        if i == j or i not in poses or j not in poses:
            raise ValueError(f"the edge {(i, j)} needs two scans that both have a pose")


def _phases(config: ContoursConfig) -> list[ContoursConfig]:
    """What is minimised one after the other, and in how many renderings."""
    if config.residual in ("point", "image"):
        return [config]
    num_last = max(1, config.num_renders // LAST_PHASE)
    num_first = max(1, config.num_renders - num_last)
    return [
        config.model_copy(update={"residual": "point", "num_renders": num_first}),
        config.model_copy(update={"residual": "image", "num_renders": num_last, "trim": LAST_TRIM}),
    ]


def _until_still(
    observed: Mapping[int, ObservedContours],
    poses: dict[int, Pose],
    edges: Sequence[tuple[int, int]],
    config: ContoursConfig,
) -> tuple[dict[int, Pose], bool]:
    """The outer loop; with the poses comes whether it came to rest before its last rendering."""
    for _ in range(config.num_renders):
        links = _holding(render_links(observed, poses, edges, config))
        if not links:
            break
        moved = _inner_loop(links, poses, _held(links, poses), config, _arm(observed))
        step = _largest_move(observed, poses, moved)
        poses = moved
        if step < CONVERGED_PIXELS:
            return poses, True
    return poses, False


def _inner_loop(
    links: Sequence[ContourLink],
    poses: dict[int, Pose],
    held: frozenset[int],
    config: ContoursConfig,
    arm: float,
) -> dict[int, Pose]:
    """Match and solve a few times, with the contours as rendered."""
    for _ in range(config.num_steps if links else 0):
        matches = _match(links, poses, config)
        poses, costs = levenberg_marquardt(
            lambda at, matches=matches: [_pulls(each, at, config) for each in matches],
            poses,
            held,
            arm,
        )
        logger.debug("contours: cost %.4g -> %.4g in %d steps", costs[0], costs[-1], len(costs))
    return poses


def _match(
    links: Sequence[ContourLink], poses: Mapping[int, Pose], config: ContoursConfig
) -> list[LinkMatches]:
    found = []
    for link in links:
        j_from_i = poses[link.j].inverse() @ poses[link.i]
        if config.matching == "mutual":
            found.append(match_mutual(link, j_from_i))
        else:
            found.append(match_trimmed(link, j_from_i, config.trim))
    return found


def _pulls(matches: LinkMatches, poses: Mapping[int, Pose], config: ContoursConfig) -> Pulls:
    return (point_pulls if config.residual == "point" else image_pulls)(matches, poses)


def _outline_rounds(
    observed: Mapping[int, ObservedContours],
    poses: dict[int, Pose],
    edges: Sequence[tuple[int, int]],
    config: ContoursConfig,
) -> dict[int, Pose]:
    """Rounds that count only the distance across the outline: contour points slide along it."""
    for pixels in np.geomspace(FIRST_MATCH_PIXELS, LAST_MATCH_PIXELS, NUM_OUTLINE_ROUNDS):
        links = _holding(render_links(observed, poses, edges, config))
        pulls = [outline_pulls(link, poses, float(pixels) * link.pixel) for link in links]
        if sum(len(each.residuals) for each in pulls) < MIN_MATCHES:
            break
        residuals = np.concatenate([each.residuals for each in pulls])
        noise = OUTLINE_NOISE_PIXELS * float(np.median([link.pixel for link in links]))
        spread = spread_of(residuals, noise)
        pulls = [replace(p, weights=tukey_weights(p.residuals, spread)) for p in pulls]
        poses = gauss_newton_step(pulls, poses, _held(links, poses), _arm(observed))
    return poses


def _judged(
    observed: Mapping[int, ObservedContours],
    poses: dict[int, Pose],
    edges: Sequence[tuple[int, int]],
    converged: bool,
    config: ContoursConfig,
) -> ContourAlignment:
    """How the contours lie at the poses found."""
    rendered = render_links(observed, poses, edges, config)
    links = _holding(rendered)
    num, square = 0, 0.0
    for matches in _match(links, poses, config):
        pulls = _pulls(matches, poses, config)
        unit = matches.link.pixel if config.residual == "point" else 1.0
        num += len(matches)
        square += float(pulls.residuals @ pulls.residuals) / unit**2
    return ContourAlignment(
        poses=poses,
        rms=float(np.sqrt(square / num)) if num else 0.0,
        num_matches=num,
        converged=converged,
        coherence=coherence([link.pair for link in rendered]),
        loose=_loose(edges, [(link.i, link.j) for link in links], len(poses) and max(poses) + 1),
    )


def _holding(links: Sequence[ContourLink]) -> list[ContourLink]:
    """The links of the edges that have contours enough, both ways."""
    weak = {frozenset((link.i, link.j)) for link in links if not link.holds}
    return [link for link in links if frozenset((link.i, link.j)) not in weak]


def _held(links: Sequence[ContourLink], poses: Mapping[int, Pose]) -> frozenset[int]:
    """The first scan of each part that the links connect, and all that no link holds."""
    first = _first_of_part([(link.i, link.j) for link in links], max(poses, default=-1) + 1)
    return frozenset(k for k in poses if first[k] == k)


def _loose(
    edges: Sequence[tuple[int, int]], held: Sequence[tuple[int, int]], num: int
) -> tuple[int, ...]:
    """Scans that the edges connect with the first of their part, and what holds does not."""
    wanted, got = _first_of_part(edges, num), _first_of_part(held, num)
    return tuple(int(k) for k in np.flatnonzero(wanted != got))


def _first_of_part(edges: Sequence[tuple[int, int]], num: int) -> np.ndarray:
    """The lowest index (num,) in the connected part of each index."""
    ends = np.array(edges, dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(ends), dtype=bool), (ends[:, 0], ends[:, 1])), shape=(num, num))
    _, part = connected_components(graph, directed=False)
    _, first = np.unique(part, return_index=True)
    return first[part]


def _arm(observed: Mapping[int, ObservedContours]) -> float:
    """The length at which a turn counts like a shift."""
    return lever_arm(float(np.median([each.scan.diameter for each in observed.values()])))


def _largest_move(
    observed: Mapping[int, ObservedContours], old: Mapping[int, Pose], new: Mapping[int, Pose]
) -> float:
    """Farthest movement of a vertex of any scan, in footprints of a pixel."""
    moves = []
    for k, each in observed.items():
        vertices = each.scan.mesh.vertices
        probes = vertices[:: max(1, len(vertices) // NUM_PROBES)]
        moves.append(np.abs(new[k].apply(probes) - old[k].apply(probes)).max())
        moves[-1] /= each.scan.image.pixel
    return float(max(moves))
