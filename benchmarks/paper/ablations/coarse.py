"""Readings of the published coarse step: threshold, mutual matches, start and points of the ICP."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

from benchmarks.paper.pages import markdown_table
from benchmarks.paper.study import Record, Result, Unit
from benchmarks.paper.success import Limit, cell
from benchmarks.paper.views import mesh_of, pose_error, virtual_scan
from scanweld.config import CoarseConfig, HeatConfig
from scanweld.heat.features import describe
from scanweld.published.coarse import register_as_published

OBJECTS = ("armadillo", "bunny")
GAPS = (10, 30, 50, 70, 90)
AZIMUTHS = (0, 90, 180, 270)
RIGHT = Limit(deg=5.0, percent=2.0)

TAKEN = "as taken"
VARIANTS: dict[str, dict[str, Any]] = {
    TAKEN: {},
    "the better half of the matches": {"signature_quantile": 0.5},
    "the better quarter of the matches": {"signature_quantile": 0.25},
    "mutual matches": {"mutual": True},
    "ICP of the keypoints alone": {"icp": "keypoints"},
    "trimmed ICP": {"trim": "auto"},
    "ours: start where the nearest signatures agree": {"start": "consensus"},
    "ours: start where the evidence is best": {"start": "evidence"},
    "the former, trimmed ICP": {"start": "consensus", "trim": "auto"},
    "the latter, trimmed ICP": {"start": "evidence", "trim": "auto"},
}


def units(quick: bool) -> list[Unit]:
    """Pairs of views."""
    if quick:
        return [{"object": "creature", "gap": 30, "azimuth": 0}]
    for name in OBJECTS:
        mesh_of(name)
    return [
        {"object": name, "gap": gap, "azimuth": azimuth}
        for name, gap, azimuth in product(OBJECTS, GAPS, AZIMUTHS)
    ]


def measure(unit: Unit) -> Result:
    """Errors of the coarse pose in each reading, None where it gives none."""
    azimuth = float(unit["azimuth"])
    i, j = (virtual_scan(unit["object"], a) for a in (azimuth, azimuth + unit["gap"]))
    of_i, of_j = (describe(view.scan, HeatConfig()) for view in (i, j))
    told: dict[str, dict[str, float | None]] = {}
    for name, change in VARIANTS.items():
        found = register_as_published(i.scan, j.scan, of_i, of_j, CoarseConfig(**change)).i_from_j
        deg, shift = (None, None)
        if found is not None:
            deg, shift = pose_error(i.from_other(j), found, j.centre(), i.diameter)
        told[name] = {"deg": deg, "percent": shift}
    return told


def page(records: Sequence[Record]) -> str:
    """Right coarse poses of the readings by gap."""
    gaps = list(dict.fromkeys(record.unit["gap"] for record in records))
    columns = [*([gap] for gap in gaps), gaps]
    rows = [
        [name, *(cell(told(records, name, column), RIGHT) for column in columns)]
        for name in VARIANTS
    ]
    return (
        "## Readings of the published coarse step\n\n"
        "The paper names no threshold for eq. 1, and leaves open on what the ICP runs. Taken are "
        "all nearest signatures, a fit to them, and ICP of the surfaces, untrimmed; the other rows "
        "change one of these. The last four are ours, and say what would have to change: a better "
        "start, and with it an ICP that leaves out what does not overlap. "
        f"Cells: coarse poses that are right ({RIGHT} of the diameter) of all, and the median "
        "error of these in degrees.\n\n"
        + markdown_table(["reading", *(f"{gap}° apart" for gap in gaps), "all"], rows)
    )


def told(
    records: Sequence[Record], name: str, gaps: Sequence[int]
) -> list[Mapping[str, float | None]]:
    """Errors of a reading at some gaps."""
    return [record.result[name] for record in records if record.unit["gap"] in gaps]
