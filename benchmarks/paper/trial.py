"""What methods make of a pair whose truth is known: errors, scores and cost."""

import time
from collections.abc import Iterable
from importlib.util import find_spec
from typing import Any

from benchmarks.paper.methods import METHODS, ScanPair
from benchmarks.paper.optional import need
from benchmarks.paper.views import pose_error
from scanweld.geometry.pose import Pose


def try_methods(
    names: Iterable[str], pair: ScanPair, start: Pose, true: Pose, diameter: float, seed: int
) -> dict[str, dict[str, Any]]:
    """Run methods on a pair, one after the other.

    Args:
        names: Of the methods.
        pair: The scans.
        start: Pose i_from_j of those methods that start at one.
        true: The true i_from_j.
        diameter: Of the object, for the error.
        seed: Of those methods that draw random numbers.

    Returns:
        By name: "deg" and "percent" (of the diameter, at the middle of j) of the error, both None
        where the method gives no pose; its "score"; whether it was "accepted", where the method
        says so; and its CPU "seconds".
    """
    centre = pair.j.samples.points.mean(axis=0)
    tried: dict[str, dict[str, Any]] = {}
    for name in names:
        began = time.process_time()
        answer = METHODS[name].run(pair, start, seed)
        seconds = time.process_time() - began
        error = (None, None)
        if answer.i_from_j is not None:
            error = pose_error(true, answer.i_from_j, centre, diameter)
        told = {"deg": error[0], "percent": error[1], "score": answer.score, "seconds": seconds}
        tried[name] = told if answer.accepted is None else {**told, "accepted": answer.accepted}
    return tried


def missing_modules(names: Iterable[str]) -> list[str]:
    """Modules that the methods of these names need and that are not installed."""
    needed = {module for name in names for module in METHODS[name].needs}
    return sorted(module for module in needed if find_spec(module) is None)


def without(names: Iterable[str], missing: Iterable[str]) -> list[str]:
    """The methods that need none of the missing modules."""
    gone = set(missing)
    return [name for name in names if not gone.intersection(METHODS[name].needs)]


def need_all(names: Iterable[str]) -> None:
    """See to it that all methods of these names can run.

    Raises:
        InputError: If a module of the extra ``bench`` is missing.
    """
    for module in missing_modules(names):
        need(module)
