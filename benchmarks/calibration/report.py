"""What the calibration found: the package's file, docs/data/calibration.json, pictures, a page."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks.blocks import markdown_table
from benchmarks.calibration.fit import Examples, held_out_probabilities
from benchmarks.calibration.learn import Learned
from benchmarks.judging.plots import draw, pictures
from benchmarks.results import Json, how_measured, machine, rounded, write_file
from benchmarks.scores import Stated

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


def _measures(examples: Examples, stated: Stated, quick: bool) -> Json:
    less = {} if quick else {name: examples.without(name) for name in examples.names}
    return {
        "count": len(stated),
        "right": stated.num_right,
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
    values = {"auc": stated.auc, "error": stated.calibration_error()}
    return {key: value if np.isfinite(value) else None for key, value in values.items()}


def _kept_from(least: float, stated: Stated) -> Json:
    is_right = stated.is_right[stated.scores >= least]
    return {"least": least, "right": int(is_right.sum()), "wrong": int((~is_right).sum())}


def calibration_told(found: Json) -> str:
    """The calibration in Markdown, for docs/trust.md."""
    both = {"pairs": found["pair"], "scans": found["scan"]}
    told = (
        f"{how_measured(found)}: {found['sets']} sets of other objects than above, and none of "
        "them in the part of the calibration that it is measured by. "
    )
    if "code" in found:
        told += f"They are of code {found['code']}.\n\n"
    else:
        told += "Their code was not recorded: it is older than that of the runs above.\n\n"
    rows = [
        (name, each["count"], each["right"], *_cells(each, auc=4, error=3, brier=3))
        for name, each in both.items()
    ]
    head = ("", "poses", "right", "AUC", "calibration error", "Brier score")
    parts = [told + markdown_table(head, rows), pictures("calibration", "poses")]
    parts += [_kept(name, each) for name, each in both.items()]
    parts += [_grounds(name, each) for name, each in both.items()]
    return "\n".join(parts)


def _cells(found: Json, **digits: int) -> list[str]:
    """Values; a few sets may have no wrong pose, and so no AUC."""
    return [f"{found[key]:.{d}f}" if found[key] is not None else "-" for key, d in digits.items()]


def _kept(name: str, found: Json) -> str:
    parts = [
        f"from {kept['least']:g} on {kept['right']} of {found['right']} right ones and "
        f"{kept['wrong']} wrong"
        for kept in found["kept"]
    ]
    return f"Of the {name} have a confidence {'; '.join(parts)}.\n"


def _grounds(name: str, found: Json) -> str:
    """How much worse the model is without each ground, the most important first."""
    known = {k: less["auc"] for k, less in found["without"].items() if less["auc"] is not None}
    lost = {ground: (found["auc"] or np.nan) - auc for ground, auc in known.items()}
    ranked = sorted(lost, key=lambda ground: -lost[ground])
    told = ", ".join(f"{ground} {1e4 * lost[ground]:+.0f}" for ground in ranked)
    return f"AUC that {name} lose without a ground, in 0.0001: {told}.\n"
