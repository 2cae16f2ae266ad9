"""The project's own steps as the study calls them: the one place that knows how they are called."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks.paper.baselines.records import Answer, ScanPair, closeness
from scanweld.config import CoarseConfig, Config, ContoursConfig, RefineConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.geometry.point_fit import FRACTION_EXPONENT, Trim
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import Features, describe
from scanweld.pairs.registrar import PairRegistrar, PairTask
from scanweld.pairs.result import PairKind, PairResult
from scanweld.published.coarse import CoarseAnswer, register_as_published
from scanweld.published.m_icc import m_icc as align_by_m_icc
from scanweld.published.mm_icc import mm_icc as align_by_mm_icc
from scanweld.published.outer_loop import ContourAlignment
from scanweld.published.point_icp import point_icp
from scanweld.published.signature_matching import match_signatures
from scanweld.refinement.refine import refine_poses

Scans = Sequence[PreparedScan]
Poses = Mapping[int, Pose]
Edges = Sequence[tuple[int, int]]

ONE_EDGE = ((0, 1),)
_ALIGN = {"m-icc": align_by_m_icc, "mm-icc": align_by_mm_icc}


def aligned(
    method: str, scans: Scans, start: Poses, edges: Edges = ONE_EDGE, **settings: Any
) -> ContourAlignment:
    """Poses ``world_from_sensor`` by ``m-icc`` or ``mm-icc``, under other settings of contours."""
    return _ALIGN[method](scans, start, edges, ContoursConfig(**settings))


def jointly_refined(
    scans: Scans, start: Poses, edges: Edges = ONE_EDGE, **settings: Any
) -> dict[int, Pose]:
    """Poses ``world_from_sensor`` by the joint refinement, under other settings of it."""
    matcher = contour_matcher(scans, ContoursConfig())
    return dict(refine_poses(scans, start, edges, RefineConfig(**settings), matcher).poses)


def coarse_pose(
    i: PreparedScan, j: PreparedScan, features: Sequence[Features] = (), **settings: Any
) -> CoarseAnswer:
    """Matched PA-HKS keypoints and ICP (paper 3.1), under another reading of them."""
    of_i, of_j = features or [describe(scan, Config().heat) for scan in (i, j)]
    return register_as_published(i, j, of_i, of_j, CoarseConfig(**settings))


def right_matches(
    i_from_j: Pose, of_i: Features, of_j: Features, reach: float, **settings: Any
) -> list[float]:
    """How many matches of eq. 1 are right, how many there are, and how many are right by chance.

    By chance a keypoint of i that has a match has any keypoint of j.
    """
    matches = match_signatures(of_i.signatures, of_j.signatures, **settings)
    apart = cdist(of_i.points[matches.s], i_from_j.apply(of_j.points))
    is_near = apart < reach
    right = is_near[np.arange(len(matches)), matches.t].sum()
    by_chance = is_near.mean(axis=1).sum() if len(matches) else 0.0
    return [float(right), float(len(matches)), float(by_chance)]


def searched(pair: ScanPair, config: Config) -> PairResult:
    """What a run does for a pair, features and all."""
    registrar = PairRegistrar(config=config)
    parts = [registrar.scan(scan, describe(scan, config.heat)) for scan in (pair.i, pair.j)]
    return registrar.register(PairTask(edge=(0, 1)), *parts)


def icp(pair: ScanPair, start: Pose, seed: int, trim: Trim = None) -> Answer:
    """Point-to-point ICP from the start; its score comes of what it minimises.

    Of all matches that is their rms; of a share that is found anew in each step (fractional ICP)
    the rms over a power of the share.
    """
    samples = pair.j.samples.points
    found = point_icp(samples, pair.i.mesh.vertices, start, trim)
    share = found.num_matches / len(samples)
    score = closeness(found.rms / share**FRACTION_EXPONENT, pair.diameter)
    return Answer(i_from_j=found.target_from_source, score=score)


def icc(pair: ScanPair, start: Pose, seed: int, method: str = "mm-icc") -> Answer:
    """M-ICC or MM-ICC as published, from the start; its score is the coherence of the contours."""
    found = aligned(method, (pair.i, pair.j), {0: Pose.identity(), 1: start})
    if found.loose:
        return Answer(i_from_j=None, score=0.0, reason="too few contours match")
    return Answer(i_from_j=found.poses[0].inverse() @ found.poses[1], score=found.coherence)


def paper_coarse(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """The published coarse step; its score comes of the ICP's rms."""
    found = coarse_pose(pair.i, pair.j)
    if found.i_from_j is None:
        return Answer(i_from_j=None, score=0.0, reason=found.reason)
    return Answer(i_from_j=found.i_from_j, score=closeness(found.rms, pair.diameter))


def paper(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """The published method: the coarse step, then MM-ICC, whose coherence is the score."""
    coarse = paper_coarse(pair, start, seed)
    return coarse if coarse.i_from_j is None else icc(pair, coarse.i_from_j, seed)


def default(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """The default method; its score is that of the best pose found."""
    result = searched(pair, Config())
    best = result.best
    return Answer(
        i_from_j=best.i_from_j if best else None,
        score=best.score if best else 0.0,
        reason=result.reason,
        accepted=result.kind is PairKind.GOOD,
    )
