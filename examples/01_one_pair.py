"""Learn to register one pair of scans by hand, and to read the evidence for its pose.

No start pose is given. Several distinct poses come back, each with what either sensor says of the
other's surface; the best one is held against the truth.
"""

from collections.abc import Sequence

import scanweld
from scanweld.evaluation.creature import creature
from scanweld.evaluation.scanner import scan_mesh
from scanweld.evaluation.views import view_of
from scanweld.evidence.field import make_field
from scanweld.heat.features import describe
from scanweld.pairs.anchors import pair_anchors
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import PairResult
from scanweld.preparation import prepare


def register(scans: Sequence[scanweld.RangeScan]) -> PairResult:
    """What the first two scans say of their relative pose, in their sensors' frames."""
    config = scanweld.Config()
    prepared = [prepare(scan, config.prepare) for scan in scans]
    diameter = max(scan.diameter for scan in prepared)
    fields = [make_field(scan, diameter) for scan in prepared]
    anchors = [
        pair_anchors(field, describe(scan, config.heat), config.pairs)
        for field, scan in zip(fields, prepared, strict=True)
    ]
    sets = list(zip(anchors[0], anchors[1], strict=True))
    return register_pair(0, 1, fields[0], fields[1], sets, diameter, config.pairs)


if __name__ == "__main__":
    mesh = creature(voxels=70)
    views = [view_of(mesh, 20, 15, pixels=140), view_of(mesh, 60, 0, roll_deg=110, pixels=140)]
    scans = [scan_mesh(mesh, view.camera, view.world_from_sensor) for view in views]
    result = register(scans)

    print(f"{result.kind}: margin {result.margin:.2f}, observability {result.observability:.1e}")
    for alternative in result.alternatives[:3]:
        evidence = alternative.evidence
        print(
            f"score {evidence.score:5.2f}: agree {evidence.agree:.2f}, front {evidence.front:.2f}"
        )
    if result.best is not None:
        truth = views[0].world_from_sensor.inverse() @ views[1].world_from_sensor
        error = truth.inverse() @ result.best.i_from_j
        print(f"the best pose is {error.angle_deg():.2f} deg off the truth")
