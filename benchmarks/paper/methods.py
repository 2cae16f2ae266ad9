"""All methods of the study by name, and what they make of a pair whose truth is known."""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.paper.baselines import cpd, fpfh, gicp, kiss, own
from benchmarks.paper.baselines.records import Method, ScanPair
from benchmarks.paper.views import pose_error
from benchmarks.study.optional import is_usable, need
from benchmarks.study.plots import Curve
from scanweld.geometry.pose import Pose


@dataclass(frozen=True, slots=True)
class Entry:
    """A method of the study.

    Attributes:
        title: For people.
        run: The method.
        color: Of its curves: the project's own are strong, what needs a start is grey.
        uses_start: Whether it starts at the given pose; else the pose makes no difference.
        needs: Modules of the extra ``bench`` that it imports.
    """

    title: str
    run: Method
    color: str
    uses_start: bool = False
    needs: tuple[str, ...] = ()


METHODS: dict[str, Entry] = {
    "icp": Entry("ICP", own.icp, "#B4B9C1", True),
    "trimmed-icp": Entry("trimmed ICP", own.trimmed_icp, "#8C929C", True),
    "point-to-plane": Entry(
        "point-to-plane ICP", gicp.point_to_plane, "#737880", True, ("small_gicp",)
    ),
    "gicp": Entry("GICP", gicp.gicp, "#555B66", True, ("small_gicp",)),
    "cpd": Entry("CPD", cpd.cpd, "#D5D8DD", True, ("pycpd",)),
    "m-icc": Entry("M-ICC", own.m_icc, "#E3B04B", True),
    "mm-icc": Entry("MM-ICC", own.mm_icc, "#B8860B", True),
    "paper-coarse": Entry("the paper's coarse step", own.paper_coarse, "#E59AAA"),
    "paper": Entry("the paper's method", own.paper, "#C2274B"),
    "fpfh-ransac": Entry("FPFH + RANSAC + ICP", fpfh.fpfh_ransac, "#3B7D4F", needs=("open3d",)),
    "fgr": Entry("FGR + ICP", fpfh.fgr, "#7FB38A", needs=("open3d",)),
    "kiss-gicp": Entry(
        "KISS-Matcher + GICP", kiss.kiss_gicp, "#7A4FA3", needs=("kiss_matcher", "small_gicp")
    ),
    "default": Entry("scanweld", own.default, "#1B6CA8"),
}
"""In the order in which tables show them."""

BY_TITLE = {entry.title: name for name, entry in METHODS.items()}


def curve(name: str, shares: Sequence[float]) -> Curve:
    """Shares of a method as plots draw them."""
    return Curve(shares, METHODS[name].color, is_strong=name in ("default", "paper"))


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
        error = pose_error(true, answer.i_from_j, centre, diameter)
        tried[name] = {**error, "score": answer.score, "seconds": seconds}
        if answer.accepted is not None:
            tried[name]["accepted"] = answer.accepted
    return tried


def missing_modules(names: Iterable[str]) -> list[str]:
    """Modules that the methods of these names need and that cannot be used here."""
    needed = {module for name in names for module in METHODS[name].needs}
    return sorted(module for module in needed if not is_usable(module))


def without(names: Iterable[str], missing: Iterable[str]) -> list[str]:
    """The methods that need none of the missing modules."""
    gone = set(missing)
    return [name for name in names if not gone.intersection(METHODS[name].needs)]


def need_all(names: Iterable[str]) -> None:
    """See to it that all methods of these names can run.

    Raises:
        InputError: If a module of the extra ``bench`` is missing or cannot be loaded.
    """
    for name in names:
        for module in METHODS[name].needs:
            need(module)
