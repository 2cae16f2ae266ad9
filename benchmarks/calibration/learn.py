"""Records of all sets -> calibration, and what it says of objects that it has not seen."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.calibration.bounds import learn_bounds
from benchmarks.calibration.collect import CONFIG
from benchmarks.calibration.fit import Examples, fit, held_out_probabilities
from benchmarks.kept import CALIBRATED, Record, code_digest
from benchmarks.scores import Stated
from scanweld.confidence.assess import cap_by_links, cap_undecided
from scanweld.confidence.model import Calibration
from scanweld.confidence.ties import ties_of
from scanweld.geometry.pose import Pose
from scanweld.graph.view_graph import Component
from scanweld.pairs.result import PairKind, PairResult
from scanweld.pairs.verdict import no_pose


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Learned:
    """What all sets together say."""

    calibration: Calibration  # The models
    pairs: Examples
    scans: Examples  # With the held-out confidences of their pairs in their links
    stated_pairs: Stated  # Held-out confidences
    stated_scans: Stated


def learn(records: Sequence[Record], command: str) -> Learned:
    """Fit both models, first the pairs': the scans' rests on it.

    Args:
        records: Of ``Sets``.
        command: That collected them.
    """
    told = [pair for record in records for pair in record.result["pairs"]]
    groups = [record.unit["seed"] for record in records for _ in record.result["pairs"]]
    pairs = Examples.of([p["grounds"] for p in told], [p["right"] for p in told], groups)
    probabilities = zip(held_out_probabilities(pairs).tolist(), told, strict=True)
    confidences = [
        cap_undecided(p, _as_told(pair), pair["grounds"], CONFIG) for p, pair in probabilities
    ]
    scans = _scan_examples(records, confidences)
    probabilities = zip(held_out_probabilities(scans).tolist(), scans.rows(), strict=True)
    held = [cap_by_links(probability, row, CONFIG) for probability, row in probabilities]
    digest = hashlib.sha256(json.dumps([record.result for record in records]).encode())
    made = {
        **{"command": command, "code": code_digest(CALIBRATED), "sets": len(records)},
        **{"pairs": int(pairs.is_known.sum()), "scans": int(scans.is_known.sum())},
        "digest": digest.hexdigest()[:16],
    }
    return Learned(
        calibration=Calibration(
            pair=fit(pairs), scan=fit(scans), bounds=learn_bounds(records), made=made
        ),
        pairs=pairs,
        scans=scans,
        stated_pairs=_stated(confidences, pairs),
        stated_scans=_stated(held, scans),
    )


def _stated(confidences: Sequence[float], examples: Examples) -> Stated:
    """The confidences of what is right or wrong."""
    known = examples.is_known
    return Stated(np.array(confidences)[known], examples.is_right[known])


def _as_told(pair: Mapping[str, Any]) -> PairResult:
    """A recorded pair, as far as its confidence asks what the two scans alone say."""
    kind, observability = PairKind(pair["kind"]), pair["observability"]
    return replace(no_pose(0, 1, ""), kind=kind, observability=observability)


def _scan_examples(records: Sequence[Record], pair_confidences: Sequence[float]) -> Examples:
    left = iter(pair_confidences)
    rows: list[tuple[dict[str, float], bool | None, int]] = []
    for record in records:
        pairs, scans = record.result["pairs"], record.result["scans"]
        confidence = {(pair["i"], pair["j"]): next(left) for pair in pairs}
        accepted = [(pair["i"], pair["j"]) for pair in pairs if pair["accepted"]]
        tied = _links(scans, {edge: confidence[edge] for edge in accepted})
        for scan in scans:
            grounds = {**scan["grounds"], "link": tied[scan["name"]]}
            rows.append((grounds, scan["right"], record.unit["seed"]))
    return Examples.of(*zip(*rows, strict=True))


def _links(
    scans: Sequence[Mapping[str, Any]], confidence: Mapping[tuple[str, str], float]
) -> dict[str, float]:
    """The links of a set's scans, by name, for these confidences of its accepted pairs."""
    names = sorted(scan["name"] for scan in scans)
    at = {name: k for k, name in enumerate(names)}
    numbered = {(at[i], at[j]): p for (i, j), p in confidence.items() if i in at and j in at}
    tied: dict[str, float] = {}
    for number in {scan["component"] for scan in scans}:
        of = [scan for scan in scans if scan["component"] == number]
        poses = {at[scan["name"]]: Pose.identity() for scan in of}
        reference = next(at[scan["name"]] for scan in of if scan["reference"])
        component = Component(poses=poses, reference=reference)
        tied.update({names[k]: link for k, link in ties_of(component, numbered).items()})
    return tied
