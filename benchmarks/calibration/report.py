"""What the calibration found: the package's file, docs/data/calibration.json and two diagrams."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.calibration.fit import Examples, held_out_probabilities
from benchmarks.calibration.learn import Learned
from benchmarks.calibration.page import RELIABILITY, RISK
from benchmarks.judging.measures import brier, calibration_error, reliability
from benchmarks.judging.plots import Stated, draw_stated
from benchmarks.paper.success import auc
from benchmarks.results import machine
from scanweld.geometry.arrays import FloatArray
from scanweld.io.atomic import write_whole

NAME = "calibration"
LEAST = (0.5, 0.8, 0.9, 0.95, 0.98)
"""Confidences from which on it is told how many of the right poses are left, and how many wrong."""

Json = dict[str, Any]


def write_all(learned: Learned, package: Path, out: Path) -> None:
    """Write the calibration for the package, its measures as JSON, and the diagrams."""
    package.parent.mkdir(parents=True, exist_ok=True)
    write_whole(package, learned.calibration.to_json().encode())
    data = out / f"data/{NAME}.json"
    data.parent.mkdir(parents=True, exist_ok=True)
    write_whole(data, (json.dumps(_rounded(measures(learned)), indent=1) + "\n").encode())
    draw(learned, out)


def measures(learned: Learned) -> Json:
    """All measures; those of right and wrong are of objects that were held out."""
    return {
        **learned.calibration.made,
        "machine": machine(),
        "pair": _measures(learned.pairs, learned.pair_confidence),
        "scan": _measures(learned.scans, learned.scan_confidence),
    }


def draw(learned: Learned, out: Path) -> None:
    """What was said against what came true, and how many are wrong of those that are taken."""
    stated = {
        "pairs": _stated(learned.pairs, learned.pair_confidence),
        "placed scans": _stated(learned.scans, learned.scan_confidence),
    }
    draw_stated(stated, out / RELIABILITY, out / RISK)


def _stated(examples: Examples, confidence: FloatArray) -> Stated:
    return list(zip(confidence.tolist(), examples.is_right.tolist(), strict=True))


def _measures(examples: Examples, confidence: FloatArray) -> Json:
    is_right = examples.is_right
    return {
        "count": len(examples),
        "right": int(is_right.sum()),
        **_quality(confidence, examples),
        "brier": brier(confidence.tolist(), is_right.tolist()),
        "bins": [asdict(b) for b in reliability(confidence.tolist(), is_right.tolist())],
        "kept": [_kept_from(least, confidence, examples) for least in LEAST],
        "without": {
            name: _quality(held_out_probabilities(less), less)
            for name in examples.names
            for less in (examples.without(name),)
        },
    }


def _quality(confidence: FloatArray, examples: Examples) -> Json:
    stated, is_right = confidence.tolist(), examples.is_right.tolist()
    return {"auc": auc(stated, is_right), "error": calibration_error(stated, is_right)}


def _kept_from(least: float, confidence: FloatArray, examples: Examples) -> Json:
    kept = confidence >= least
    return {
        "least": least,
        "right": int((kept & examples.is_right).sum()),
        "wrong": int((kept & ~examples.is_right).sum()),
    }


def _rounded(value: Any) -> Any:
    """Floats to a few significant digits, at any depth."""
    if isinstance(value, float):
        return float(f"{value:.5g}") if np.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return [_rounded(item) for item in value] if isinstance(value, list) else value
