"""A pose that was found elsewhere, judged as strictly as the search judges its own answers."""

from dataclasses import replace

from scanweld.config import PairsConfig
from scanweld.evidence.field import ScanField
from scanweld.geometry.pose import Pose
from scanweld.pairs.alternatives import alternative_at
from scanweld.pairs.anchors import even_anchors
from scanweld.pairs.register import is_same, register_pair
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pairs.verdict import result_of


def judge_pose(
    i: int,
    j: int,
    field_i: ScanField,
    field_j: ScanField,
    i_from_j: Pose,
    diameter: float,
    config: PairsConfig,
) -> PairResult:
    """Classify a pair by one pose, whose rivals are looked for if it looks good.

    A pose that is alone has no rival and would look sure. So the search from any start is asked
    what else explains the scans. What it finds counts against the pose and is not taken over.

    Args:
        i: Index of the first scan,
        j: of the second, i < j.
        field_i: The first scan, laid out.
        field_j: The second.
        i_from_j: The pose between the sensor frames.
        diameter: Diameter of the run.
        config: Settings.
    """
    fine = config.tolerance_diameters[2] * diameter
    given = alternative_at(field_i, field_j, i_from_j, fine)
    result = result_of(i, j, field_i, field_j, (given,), diameter, config)
    if result.kind is not PairKind.GOOD:
        return result
    anchors = [
        (even_anchors(field_i, config.num_anchors), even_anchors(field_j, config.num_anchors))
    ]
    found = register_pair(i, j, field_i, field_j, anchors, diameter, config).alternatives
    rivals = [option for option in found if not is_same(option, given, field_j, diameter)]
    judged = result_of(i, j, field_i, field_j, (given, *rivals), diameter, config)
    return replace(judged, alternatives=(given,))
