"""Ablations: what each part of the method is worth."""

from benchmarks.paper.ablations import search
from benchmarks.paper.ablations.parts import PARTS
from benchmarks.paper.real import real_pair
from benchmarks.paper.views import MADE, pair_units, virtual_pair
from benchmarks.study.study import Result, Unit

NAME = "ablations"


def units(quick: bool) -> list[Unit]:
    """Pairs of views for each part, and the thin ones among the real pairs for the search."""
    if quick:
        return [
            {"part": name, "object": MADE, "gap": part.quick_gap, "azimuth": 0, **part.more}
            for name, part in PARTS.items()
        ]
    units = [
        {"part": name, **unit}
        for name, part in PARTS.items()
        for unit in pair_units(part.gaps, part.azimuths, **part.more)
    ]
    return [*units, *({"part": "search", **unit} for unit in search.thin_real_pairs())]


def measure(unit: Unit) -> Result:
    """Measure one unit of its part."""
    if "i" in unit:
        return search.measure(real_pair(unit["object"], (), unit["i"], unit["j"]), unit)
    noise = unit.get("noise", 0.0)
    pair = virtual_pair(unit["object"], unit["azimuth"], unit["gap"], noise)
    return PARTS[unit["part"]].measure(pair, unit)
