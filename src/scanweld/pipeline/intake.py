"""What comes in: scans prepared, sorted by content, those that cannot take part, what is known."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from scanweld.config import Config
from scanweld.errors import InputError, some_of
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import RangeScan, principal_diameter
from scanweld.knowledge.by_index import IndexedKnowledge
from scanweld.knowledge.facts import Knowledge
from scanweld.pipeline.preparations import Preparation, try_prepare
from scanweld.preparation import stands_on_support
from scanweld.work.progress import ScanRefused
from scanweld.work.stage_log import Stages, work_key

Refuse = Callable[[str, str], None]
"""Called with a scan's name and the reason why it cannot take part."""

MAX_SIZE_RATIO = 6.0
"""A scan this many times larger or smaller than the others is in another unit, or not of it."""
MOST = 0.6
"""Share of the scans that must show a table: a plane in a few of them is the object's own."""
UNIT_RATIOS = {
    1000.0: "m and mm",
    100.0: "m and cm",
    10.0: "cm and mm",
    25.4: "in and mm",
    39.37: "m and in",
    2.54: "in and cm",
}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Intake:
    """The scans of a run.

    Attributes:
        prepared: Those that take part, ordered by their content.
        diameter: Median diameter of these.
        refused: Reason for each of the others, by name.
        scans: All that could be read, by name.
        knowledge: What users know beforehand, by name.
        known: The same of those that take part, by index.
    """

    prepared: tuple[PreparedScan, ...]
    diameter: float
    refused: Mapping[str, str]
    scans: Mapping[str, RangeScan]
    knowledge: Knowledge
    known: IndexedKnowledge


def take_in(
    scans: Sequence[RangeScan],
    unreadable: Mapping[str, str],
    knowledge: Knowledge,
    config: Config,
    stages: Stages,
) -> Intake:
    """Prepare all scans; leave out duplicates, scans of another size and what shows no surface.

    Raises:
        InputError: If fewer than two scans are left, or two have the same name.
        KnowledgeError: If what is known is about scans that are not there.
    """
    names = [scan.name for scan in scans]
    if len(set(names)) < len(names):
        raise InputError("two scans have the same name; names must be unique")
    knowledge.check_names({*names, *unreadable})
    refused = dict(unreadable)

    def refuse(name: str, reason: str) -> None:
        if name not in refused:
            refused[name] = reason
            stages.progress(ScanRefused(scan=name, reason=reason))

    def take(scan: RangeScan, outcome: Preparation | str) -> None:
        if isinstance(outcome, str):
            refuse(scan.name, outcome)
            taken.pop(scan.name, None)
        else:
            taken[scan.name] = outcome.of(scan, hashes[scan.name])

    def key(stage: str, scan: RangeScan) -> str:
        return work_key(stage, hashes[scan.name], scan.viewpoint, config.prepare)

    hashes = {scan.name: scan.content_hash() for scan in scans}
    taken: dict[str, PreparedScan] = {}
    with stages.stage("prepare") as counts:
        kept = _of_one_size(_without_duplicates(scans, hashes, refuse), refuse)
        ready = partial(try_prepare, config=config.prepare)
        stages.each("prepare", ready, kept, partial(key, "prepare"), take)
        again = _on_support(kept, taken, config)
        ready = partial(ready, without_support=True)
        outcomes = stages.done(ready, again, partial(key, "prepare without support"))
        for scan, outcome in zip(again, outcomes, strict=True):
            take(scan, outcome)
        prepared = list(taken.values())
        counts["scans"] = len(prepared)
        counts["refused"] = len(refused)
    require_two(prepared, refused)
    prepared.sort(key=lambda scan: (scan.content_hash, scan.name))
    return Intake(
        prepared=tuple(prepared),
        diameter=float(np.median([scan.diameter for scan in prepared])),
        refused=refused,
        scans={scan.name: scan for scan in scans},
        knowledge=knowledge,
        known=knowledge.by_index(prepared),
    )


def require_two(prepared: Sequence[PreparedScan], refused: Mapping[str, str]) -> None:
    """Make sure that there is something to put together.

    Args:
        prepared: The scans that take part.
        refused: Reason for each of the others, by name.

    Raises:
        InputError: If there are fewer than two.
    """
    if len(prepared) < 2:
        told = some_of([f"{name}: {reason}" for name, reason in sorted(refused.items())])
        raise InputError(
            f"{len(prepared)} usable scan{'s' * (len(prepared) != 1)}; give at least 2"
            + (f" ({told})" if told else "")
        )


def _without_duplicates(
    scans: Sequence[RangeScan], hashes: Mapping[str, str], refuse: Refuse
) -> list[RangeScan]:
    first: dict[str, str] = {}
    kept = []
    for scan in sorted(scans, key=lambda scan: scan.name):
        original = first.setdefault(hashes[scan.name], scan.name)
        if original == scan.name:
            kept.append(scan)
        else:
            refuse(scan.name, f"same content as {original}, which is kept")
    return kept


def _of_one_size(scans: Sequence[RangeScan], refuse: Refuse) -> list[RangeScan]:
    sizes = [principal_diameter(scan.points) if len(scan.points) > 3 else 0.0 for scan in scans]
    usual = float(np.median([size for size in sizes if size > 0] or [0.0]))
    kept = []
    for scan, size in zip(scans, sizes, strict=True):
        ratio = max(size / usual, usual / size) if size > 0 and usual > 0 else 1.0
        if ratio <= MAX_SIZE_RATIO:
            kept.append(scan)
            continue
        larger = "larger" if size > usual else "smaller"
        told = f"{ratio:.3g} times {larger} than the other scans{_unit_hint(ratio)}"
        refuse(scan.name, told)
    return kept


def _unit_hint(ratio: float) -> str:
    closest = min(UNIT_RATIOS, key=lambda known: abs(np.log(ratio / known)))
    if abs(np.log(ratio / closest)) > np.log(2.0):
        return "; is it of the same object?"
    return f"; units mixed up ({UNIT_RATIOS[closest]})? Give all scans in one unit"


def _on_support(
    scans: Sequence[RangeScan], taken: Mapping[str, PreparedScan], config: Config
) -> list[RangeScan]:
    """Scans that stand on a table, if it is to go and most show one."""
    if config.prepare.support != "left out":
        return []
    standing = {name for name, scan in taken.items() if stands_on_support(scan)}
    if not standing or len(standing) < MOST * len(taken):
        return []
    return [scan for scan in scans if scan.name in standing]
