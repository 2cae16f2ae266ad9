"""Keypoints against evenly spread points, and what each term of the evidence is worth."""

from collections.abc import Mapping, Sequence

from benchmarks.paper.baselines.own import searched
from benchmarks.paper.views import KnownPair, data_file
from benchmarks.scores import Stated
from benchmarks.sets import overlaps_of
from benchmarks.study.records import Limit
from benchmarks.study.study import Record, Result, Unit
from scanweld.config import Config, PairsConfig
from scanweld.evaluation import metrics
from scanweld.evidence.evidence import CONTRADICT_WEIGHT, FREE_WEIGHT, VIOLATION_WEIGHT
from scanweld.heat.features import describe

REAL = ("stanford-bunny", "stanford-dragon")
THIN_OVERLAPS = (0.03, 0.25)
MIN_ANCHORS = 8
RIGHT = Limit(deg=metrics.RIGHT.rotation_deg, percent=metrics.RIGHT.translation_percent)

ANCHORS = {
    "PA-HKS keypoints alone": "heat",
    "as many evenly spread points": "even",
    "the default: both, evenly spread ones by number": "mixed",
}
SHARES = ("agree", "front", "contradict", "free")
WEIGHTS = {
    "as it stands": (VIOLATION_WEIGHT, CONTRADICT_WEIGHT, FREE_WEIGHT),
    "violations weighted like agreement": (1.0, 0.5, FREE_WEIGHT),
    "without what lies in front": (0.0, CONTRADICT_WEIGHT, FREE_WEIGHT),
    "without contradicting normals": (VIOLATION_WEIGHT, 0.0, FREE_WEIGHT),
    "without free space": (VIOLATION_WEIGHT, CONTRADICT_WEIGHT, 0.0),
    "agreement alone": (0.0, 0.0, 0.0),
}
"""Scores by the weights of what lies in front, contradicts, and lies in free space."""


def thin_real_pairs() -> list[Unit]:
    """The pairs of real scans that overlap little."""
    return [
        {"object": folder, **{key: row[key] for key in ("i", "j", "overlap")}}
        for folder in REAL
        for row in overlaps_of(data_file(f"{folder}/overlaps.csv").parent)
        if THIN_OVERLAPS[0] <= row["overlap"] < THIN_OVERLAPS[1]
    ]


def measure(pair: KnownPair, unit: Unit) -> Result:
    """The first answer with each set of anchors; with the default's, all poses that are kept."""
    keypoints = sum(len(describe(scan, Config().heat)) for scan in (pair.i, pair.j))
    number = max(MIN_ANCHORS, round(keypoints / 2))
    anchors = {
        "heat": PairsConfig(keypoints="heat"),
        # As many evenly spread points as there are keypoints, where they stand in for them.
        "even": PairsConfig(keypoints="even", num_anchors=number),
        "mixed": PairsConfig(keypoints="mixed"),
    }
    kept = {
        kind: [
            pair.error(found.i_from_j) | {share: getattr(found.evidence, share) for share in SHARES}
            for found in searched(pair.scans, Config(pairs=config)).alternatives
        ]
        for kind, config in anchors.items()
    }
    return {
        "anchors": number,
        **{kind: poses if kind == "mixed" else poses[:1] for kind, poses in kept.items()},
    }


def rescored(records: Sequence[Record], name: str) -> tuple[list[bool], float]:
    """Whether the best pose of each pair by a score is right, and its AUC over all poses kept."""
    front, contradict, free = WEIGHTS[name]

    def score(pose: Mapping[str, float]) -> float:
        violated = front * pose["front"] + contradict * pose["contradict"]
        return pose["agree"] - violated - free * pose["free"]

    kept = [record.result["mixed"] for record in records]
    firsts = [bool(poses) and RIGHT.holds(max(poses, key=score)) for poses in kept]
    told = ((score(pose), RIGHT.holds(pose)) for poses in kept for pose in poses)
    return firsts, Stated.of(told).auc
