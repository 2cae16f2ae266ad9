"""The project's own methods on a pair: ICP, the published path and its parts, and the default."""

from benchmarks.paper.baselines.records import Answer, ScanPair
from scanweld.config import Config
from scanweld.contours.coherence import contour_matcher
from scanweld.geometry.pose import Pose
from scanweld.heat.features import describe
from scanweld.pairs.field import make_field
from scanweld.pairs.point_icp import point_icp
from scanweld.pairs.result import PairKind
from scanweld.pipeline import pair_registrar


def icp(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """Point-to-point ICP from the start; its score is the rms it ends with, negative."""
    return _icp(pair, start, None)


def trimmed_icp(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """The same with the share of matches found anew in each step (fractional ICP)."""
    return _icp(pair, start, "auto")


def default(pair: ScanPair, start: Pose, seed: int) -> Answer:
    """What a run does for a pair, features and all; its score is that of the best pose found."""
    config, scans = Config(), (pair.i, pair.j)
    register = pair_registrar(
        scans,
        [describe(scan, config.heat) for scan in scans],
        [make_field(scan, pair.diameter) for scan in scans],
        contour_matcher(scans, config.contours),
        pair.diameter,
        config,
    )
    result = register((0, 1))
    accepted = result.kind is PairKind.GOOD
    if result.best is None:
        return Answer(i_from_j=None, score=0.0, reason=result.reason, accepted=accepted)
    best = result.best
    return Answer(i_from_j=best.i_from_j, score=best.score, reason=result.reason, accepted=accepted)


def _icp(pair: ScanPair, start: Pose, trim: None | str) -> Answer:
    found = point_icp(pair.j.samples.points, pair.i.mesh.vertices, start, trim)
    return Answer(i_from_j=found.target_from_source, score=-found.rms / pair.diameter)
