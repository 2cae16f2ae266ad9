"""What the calibration found: the package's file, docs/data/calibration.json and pictures."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks.calibration.fit import Examples, held_out_probabilities
from benchmarks.calibration.learn import Learned
from benchmarks.results import Json, how_measured, machine, rounded, write_file
from benchmarks.scores import Stated, draw

LEAST = (0.5, 0.8, 0.9, 0.95, 0.98)
"""Confidences from which on it is told how many of the right poses are left, and how many wrong."""


def write_all(learned: Learned, package: Path, out: Path, *, quick: bool = False) -> Json:
    """Write the calibration for the package, its measures as JSON, and the pictures."""
    found = measures(learned, quick=quick)
    write_file(package, learned.calibration.to_json())
    write_file(out / "data/calibration.json", json.dumps(rounded(found, 5), indent=1) + "\n")
    stated = {"pairs": learned.stated_pairs, "placed scans": learned.stated_scans}
    draw(stated, out, "calibration")
    return found


def measures(learned: Learned, *, quick: bool = False) -> Json:
    """All measures, of objects that were held out; if quick, not without each of the grounds."""
    return {
        **learned.calibration.made,
        "machine": machine(),
        "pair": _measures(learned.pairs, learned.stated_pairs, quick),
        "scan": _measures(learned.scans, learned.stated_scans, quick),
    }


def calibration_told(found: Json) -> Json:
    """The values of the calibration's template: how much is lost without a ground, most first."""
    lost = {}
    for name, each in (("pairs", found["pair"]), ("scans", found["scan"])):
        left = {k: less["auc"] for k, less in each["without"].items() if less["auc"] is not None}
        less = [(ground, (each["auc"] or np.nan) - auc) for ground, auc in left.items()]
        lost[name] = sorted(less, key=lambda ground: -ground[1])
    return {"how": how_measured(found), "found": found, "lost": lost}


def _measures(examples: Examples, stated: Stated, quick: bool) -> Json:
    known = examples.only(examples.is_known)
    less = {} if quick else {name: known.without(name) for name in examples.names}
    return {
        **{"count": len(stated), "right": stated.num_right},
        **_quality(stated),
        "brier": stated.brier,
        "bins": [asdict(b) for b in stated.bins()],
        "kept": [_kept_from(least, stated) for least in LEAST],
        "without": {
            name: _quality(Stated(held_out_probabilities(some), some.is_right))
            for name, some in less.items()
        },
    }


def _quality(stated: Stated) -> Json:
    """A few sets may have no wrong pose, and so no AUC."""
    values = {"auc": stated.auc, "error": stated.calibration_error()}
    return {key: value if np.isfinite(value) else None for key, value in values.items()}


def _kept_from(least: float, stated: Stated) -> Json:
    is_right = stated.is_right[stated.scores >= least]
    return {"least": least, "right": int(is_right.sum()), "wrong": int((~is_right).sum())}
