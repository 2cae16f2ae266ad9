"""The project's own methods on a pair: ICP, the published method and its parts, and the default."""

from collections.abc import Callable, Mapping, Sequence

from benchmarks.paper.baselines.records import Answer, ScanPair, closeness
from scanweld.config import Config, ContoursConfig
from scanweld.contours.coherence import contour_matcher
from scanweld.evidence.field import make_field
from scanweld.geometry.point_fit import FRACTION_EXPONENT, Trim
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.heat.features import describe
from scanweld.pairs.result import PairKind
from scanweld.pipeline.robust import pair_registrar
from scanweld.published.coarse import register_as_published
from scanweld.published.m_icc import m_icc as align_by_m_icc
from scanweld.published.mm_icc import mm_icc as align_by_mm_icc
from scanweld.published.outer_loop import ContourAlignment
from scanweld.published.point_icp import point_icp

Edges = Sequence[tuple[int, int]]
Align = Callable[
    [Sequence[PreparedScan], Mapping[int, Pose], Edges, ContoursConfig], ContourAlignment
]

AS_PUBLISHED = ContoursConfig()


def icp(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """Point-to-point ICP from the start; its score comes of the rms it ends with."""
    return _icp(pair, start, None)


def trimmed_icp(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """The same with the share of matches found anew in each step (fractional ICP).

    Its score comes of what it minimises: the rms over a power of the share.
    """
    return _icp(pair, start, "auto")


def m_icc(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """M-ICC from the start; its score is the coherence of the contours."""
    return _by_contours(pair, start, align_by_m_icc)


def mm_icc(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """MM-ICC as published, from the start; its score is the coherence of the contours."""
    return _by_contours(pair, start, align_by_mm_icc)


def paper_coarse(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """Matched PA-HKS keypoints and ICP (paper 3.1); its score comes of the ICP's rms."""
    config = Config()
    features_i, features_j = (describe(scan, config.heat) for scan in (pair.i, pair.j))
    found = register_as_published(pair.i, pair.j, features_i, features_j, config.coarse)
    if found.i_from_j is None:
        return Answer(i_from_j=None, score=0.0, reason=found.reason)
    return Answer(i_from_j=found.i_from_j, score=closeness(found.rms, pair.diameter))


def paper(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """The published method: the coarse step, then MM-ICC, whose coherence is the score."""
    coarse = paper_coarse(pair, start, seed)
    return coarse if coarse.i_from_j is None else mm_icc(pair, coarse.i_from_j, seed)


def default(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """What a run does for a pair, features and all; its score is that of the best pose found."""
    config, scans = Config(), (pair.i, pair.j)
    registrar = pair_registrar(
        scans,
        [describe(scan, config.heat) for scan in scans],
        [make_field(scan) for scan in scans],
        contour_matcher(scans, config.contours),
        config,
    )
    result = registrar.register((0, 1))
    best = result.best
    return Answer(
        i_from_j=best.i_from_j if best else None,
        score=best.score if best else 0.0,
        reason=result.reason,
        accepted=result.kind is PairKind.GOOD,
    )


def _icp(pair: ScanPair, start: Pose, trim: Trim) -> Answer:
    samples = pair.j.samples.points
    found = point_icp(samples, pair.i.mesh.vertices, start, trim)
    share = found.num_matches / len(samples)
    return Answer(
        i_from_j=found.target_from_source,
        score=closeness(found.rms / share**FRACTION_EXPONENT, pair.diameter),
    )


def _by_contours(pair: ScanPair, start: Pose, align: Align) -> Answer:
    found = align((pair.i, pair.j), {0: Pose.identity(), 1: start}, [(0, 1)], AS_PUBLISHED)
    if found.loose:
        return Answer(i_from_j=None, score=0.0, reason="too few contours match")
    i_from_j = found.poses[0].inverse() @ found.poses[1]
    return Answer(i_from_j=i_from_j, score=found.coherence)
