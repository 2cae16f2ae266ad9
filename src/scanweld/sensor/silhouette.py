"""How far the silhouettes of a set can be believed.

A sensor that looked past an object speaks against all that would have stood there. But scans are
trimmed, cropped and eaten at their edges, and then empty pixels say nothing. Where surfaces alone
make a pair certain, what lies in free space tells: beside true silhouettes next to nothing does,
beside cut borders as much as was cut. Farther out than that, empty pixels speak as ever.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from scanweld.evidence.field import RASTER_KIND, RASTER_OUTSIDE, ScanField
from scanweld.evidence.visibility import IS_FREE, MIN_FACING
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose
from scanweld.pairs.result import PairResult
from scanweld.sensor.certain import Edge, certain_pairs

EXCUSED_SHARE = 0.03
"""Of what agrees, so much may lie in free space anywhere."""
MAX_MARGIN_DIAMETERS = 0.1
"""Wrong poses put parts of an object 5 to 25 % of its diameter into free space: no set excuses all
of that."""


def silhouette_margin(
    pairs: Mapping[Edge, PairResult], fields: Sequence[ScanField], diameter: float, least: float
) -> float:
    """Distance from silhouettes within which empty pixels say nothing, in the scans' unit.

    The median over certain pairs of the distance beyond which next to nothing of either scan lies
    in the other's free space and faces that sensor.

    Args:
        pairs: All pairs, judged.
        fields: All scans, laid out, silhouettes being believed.
        diameter: Of the run, in the scans' unit.
        least: Distance below which silhouettes are as good as the surfaces are.
    """
    found = [_distance(pair, fields) for pair in certain_pairs(pairs.values())]
    margin = float(np.median(found)) if found else 0.0
    return min(margin, MAX_MARGIN_DIAMETERS * diameter) if margin > least else 0.0


def _distance(pair: PairResult, fields: Sequence[ScanField]) -> float:
    """The same of one pair."""
    best, i, j = pair.alternatives[0], fields[pair.i], fields[pair.j]
    both = _outside(j, i, best.i_from_j), _outside(i, j, best.i_from_j.inverse())
    distances = np.concatenate(both)
    shares = np.concatenate([np.full(len(k), 0.5 / max(len(k), 1)) for k in both])
    order = np.argsort(-distances, kind="stable")
    excused = np.cumsum(shares[order]) <= EXCUSED_SHARE * best.evidence.agree
    return float(distances[order][~excused][0]) if not excused.all() else 0.0


def _outside(scan: ScanField, there: ScanField, there_from_scan: Pose) -> FloatArray:
    """How far outside of another scan's silhouette samples (N,) that face its sensor lie."""
    points, normals = there_from_scan.apply(scan.points), there_from_scan.turn(scan.normals)
    kind, fx, fy, cx, cy = there.camera
    is_pinhole = kind == 0.0
    away = points[:, 2] if is_pinhole else np.ones(len(points))
    rays = points if is_pinhole else np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        places = points[:, :2] * (fx, fy) / away[:, None] + (cx, cy)
        facing = -np.einsum("nk,nk->n", normals, rays) / np.linalg.norm(rays, axis=1)
    places = np.where((away > 0.0)[:, None], places, 0.0)
    height, width = there.raster.shape[:2]
    inside = np.clip(places, 0.0, (width - 1.0, height - 1.0))
    column, row = (inside + 0.5).astype(np.int64).T
    pixel = there.raster[row, column]
    beyond = (np.abs(places - inside) / (fx, fy)).sum(axis=1) * away
    is_free = (pixel[:, RASTER_KIND] == IS_FREE) & (away > 0.0) & (facing > MIN_FACING)
    return np.where(is_free, pixel[:, RASTER_OUTSIDE] + beyond, 0.0)
