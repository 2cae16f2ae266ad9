"""Poses against the truth, as a table."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scanweld.errors import InputError
from scanweld.evaluation.metrics import (
    PoseErrors,
    ScanError,
    Standing,
    evaluate,
)
from scanweld.io import natural_key, read_poses
from scanweld.io.depth.capture import DepthOptions, as_named, collect_named


def compare(
    estimate: Path | str, truth: Path | str, scans: Sequence[Path | str] = ()
) -> PoseErrors:
    """Errors of a file of poses against a file of true poses.

    Args:
        estimate: poses.json of a run.
        truth: True poses, in the same format or as a flat ``{name: 4x4}``.
        scans: The scans themselves, if at hand: then translations are taken at their centroids and
            also given in percent of the object's diameter.

    Raises:
        ScanweldError: If a file cannot be read, or the two have no scan in common.
    """
    reference = read_poses(truth).poses
    found = read_poses(estimate)
    if not scans:
        return evaluate(found, reference)
    named = collect_named(as_named(scans, DepthOptions()))
    files = {file.name: file for file in named if file.name in reference}
    if missing := sorted(set(reference) & set(found.poses) - set(files), key=natural_key):
        raise InputError(f"{missing[0]}: has a pose but is not among the scans given")
    read = [file.read() for file in files.values()]
    return evaluate(found, reference, read)


def comparison_table(errors: PoseErrors) -> str:
    """A line a scan, then how many are right and how large the errors are."""
    names = sorted(errors.scans, key=natural_key)
    width = max((len(name) for name in names), default=0)
    lines = [f"{name:<{width}}  {_line(errors.scans[name], errors.diameter)}" for name in names]
    counts = ", ".join(f"{errors.count(standing)} {standing.value}" for standing in Standing)
    lines.append(f"of {len(names)} scans: {counts}")
    if len(errors.rotations_deg):
        turn, shift = errors.rotations_deg, errors.translations
        lines.append(f"rotation error, mean / max: {turn.mean():.3f} / {turn.max():.3f} deg")
        unit = "in the scans' unit, at their origins"
        text = f"{shift.mean():.4g} / {shift.max():.4g}"
        if errors.diameter:
            shift, unit = errors.translations_percent, "% of the diameter"
            text = f"{shift.mean():.3f} / {shift.max():.3f}"
        lines.append(f"translation error, mean / max: {text} {unit}")
    return "\n".join(lines)


def _line(error: ScanError, diameter: float | None) -> str:
    if not np.isfinite(error.rotation_deg):
        return error.standing.value
    shift = f"{error.translation:.4g}"
    if diameter:
        shift = f"{100 * error.translation / diameter:.3f} %"
    return f"{error.standing.value:<8}  {error.rotation_deg:.3f} deg  {shift}"
