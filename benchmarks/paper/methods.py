"""All methods of the study by name."""

from dataclasses import dataclass

from benchmarks.paper.baselines import cpd, fpfh, gicp, kiss, own
from benchmarks.paper.baselines.records import Answer, Method, ScanPair
from scanweld.errors import InputError

__all__ = ["METHODS", "Answer", "Entry", "Method", "ScanPair", "method"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Entry:
    """A method of the study.

    Attributes:
        name: By which tables and their JSON call it.
        title: For people.
        run: The method.
        uses_start: Whether it starts at the given pose; else the pose makes no difference.
        needs: Modules of the extra ``bench`` that it imports.
    """

    name: str
    title: str
    run: Method
    uses_start: bool
    needs: tuple[str, ...] = ()


_ENTRIES = (
    Entry(name="icp", title="ICP", run=own.icp, uses_start=True),
    Entry(name="trimmed-icp", title="trimmed ICP", run=own.trimmed_icp, uses_start=True),
    Entry(
        name="point-to-plane",
        title="point-to-plane ICP",
        run=gicp.point_to_plane,
        uses_start=True,
        needs=("small_gicp",),
    ),
    Entry(name="gicp", title="GICP", run=gicp.gicp, uses_start=True, needs=("small_gicp",)),
    Entry(name="cpd", title="CPD", run=cpd.cpd, uses_start=True, needs=("pycpd",)),
    Entry(name="m-icc", title="M-ICC", run=own.m_icc, uses_start=True),
    Entry(name="mm-icc", title="MM-ICC", run=own.mm_icc, uses_start=True),
    Entry(
        name="fpfh-ransac",
        title="FPFH + RANSAC + ICP",
        run=fpfh.fpfh_ransac,
        uses_start=False,
        needs=("open3d",),
    ),
    Entry(name="fgr", title="FGR + ICP", run=fpfh.fgr, uses_start=False, needs=("open3d",)),
    Entry(
        name="kiss-gicp",
        title="KISS-Matcher + GICP",
        run=kiss.kiss_gicp,
        uses_start=False,
        needs=("kiss_matcher", "small_gicp"),
    ),
    Entry(
        name="paper-coarse",
        title="the paper's coarse step",
        run=own.paper_coarse,
        uses_start=False,
    ),
    Entry(name="paper", title="the paper's method", run=own.paper, uses_start=False),
    Entry(name="default", title="scanweld", run=own.default, uses_start=False),
)
METHODS: dict[str, Entry] = {entry.name: entry for entry in _ENTRIES}


def method(name: str) -> Entry:
    """The method of this name.

    Raises:
        InputError: If there is none; the message names those that are.
    """
    if name not in METHODS:
        raise InputError(f"{name}: no such method; there are {', '.join(METHODS)}")
    return METHODS[name]
