"""All methods of the study by name, and what they make of a pair whose truth is known."""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

from benchmarks.paper.baselines import cpd, fpfh, gicp, kiss, own
from benchmarks.paper.baselines.records import Method
from benchmarks.paper.views import KnownPair
from benchmarks.study.optional import is_usable, need
from scanweld.geometry.pose import Pose


@dataclass(frozen=True, slots=True)
class Entry:
    """A method of the study."""

    title: str  # For people
    run: Method
    color: str  # Of its curves: the project's own are strong, what needs a start is grey
    uses_start: bool = False  # Else the given pose makes no difference
    needs: tuple[str, ...] = ()  # Modules of the extra ``bench`` that it imports


_TO_PLANE: Method = partial(gicp.gicp, kind="PLANE_ICP")
METHODS: dict[str, Entry] = {
    "icp": Entry("ICP", own.icp, "#B4B9C1", True),
    "trimmed-icp": Entry("trimmed ICP", partial(own.icp, trim="auto"), "#8C929C", True),
    "point-to-plane": Entry("point-to-plane ICP", _TO_PLANE, "#737880", True, ("small_gicp",)),
    "gicp": Entry("GICP", gicp.gicp, "#555B66", True, ("small_gicp",)),
    "cpd": Entry("CPD", cpd.cpd, "#D5D8DD", True, ("pycpd",)),
    "m-icc": Entry("M-ICC", partial(own.icc, method="m-icc"), "#E3B04B", True),
    "mm-icc": Entry("MM-ICC", own.icc, "#B8860B", True),
    "paper-coarse": Entry("the paper's coarse step", own.paper_coarse, "#E59AAA"),
    "paper": Entry("the paper's method", own.paper, "#C2274B"),
    "fpfh-ransac": Entry("FPFH + RANSAC + ICP", fpfh.fpfh_ransac, "#3B7D4F", needs=("open3d",)),
    "fgr": Entry("FGR + ICP", fpfh.fgr, "#7FB38A", needs=("open3d",)),
    "kiss-gicp": Entry("KISS-Matcher + GICP", kiss.kiss_gicp, "#7A4FA3", needs=kiss.NEEDS),
    "default": Entry("scanweld", own.default, "#1B6CA8"),
}
"""In the order in which tables show them."""
BY_TITLE = {entry.title: name for name, entry in METHODS.items()}


def try_methods(
    names: Iterable[str], pair: KnownPair, start: Pose, seed: int
) -> dict[str, dict[str, Any]]:
    """Run methods on a pair, one after the other, but for those whose library is not there.

    By name: "deg" and "percent" of the error, the method's "score", whether it "accepted" its pose,
    where it says so, and its CPU "seconds". The start is an i_from_j for the methods that take one.
    """
    tried: dict[str, dict[str, Any]] = {}
    missing = missing_modules()
    for name in names:
        if missing.intersection(METHODS[name].needs):
            continue
        began = time.process_time()
        answer = METHODS[name].run(pair.scans, start, seed)
        seconds = time.process_time() - began
        tried[name] = {**pair.error(answer.i_from_j), "score": answer.score, "seconds": seconds}
        if answer.accepted is not None:
            tried[name]["accepted"] = answer.accepted
    return tried


def missing_modules() -> set[str]:
    """Modules that some methods need and that cannot be used here."""
    needed = {module for entry in METHODS.values() for module in entry.needs}
    return {module for module in needed if not is_usable(module)}


def need_all(names: Iterable[str]) -> None:
    """See to it that all methods of these names can run."""
    for name in names:
        for module in METHODS[name].needs:
            need(module)
