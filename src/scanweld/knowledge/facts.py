"""What users know of their scans beforehand: named, checked, and never blindly believed."""

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

from pydantic import ValidationError

from scanweld.config import Section
from scanweld.errors import KnowledgeError
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.io import PoseSet, natural_key, read_poses
from scanweld.knowledge.by_index import IndexedKnowledge

Pair = tuple[str, str]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Knowledge:
    """Facts about scans, by name; each is checked against the evidence and reported.

    Attributes:
        fix: Scans whose frame is the world, or which stay at their start pose if they have one;
            the first that a component holds is its reference.
        start: Poses to be tried besides those that are found.
        together: Pairs of one object that see some of the same surface: they are believed on half
            the usual score and margin, never against violations.
        apart: Pairs whose scans must not be laid onto each other.
        turntable: Whether all scans relate by turns about one, unknown axis.
    """

    fix: tuple[str, ...] = ()
    start: PoseSet | None = None
    together: tuple[Pair, ...] = ()
    apart: tuple[Pair, ...] = ()
    turntable: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "fix", tuple(dict.fromkeys(self.fix)))
        for key in ("together", "apart"):
            object.__setattr__(self, key, _in_order(key, getattr(self, key)))
        if both := [pair for pair in self.together if pair in self.apart]:
            i, j = both[0]
            raise KnowledgeError(f"{i} and {j} are said to be both together and apart; choose one")

    def __bool__(self) -> bool:
        """Whether anything is known."""
        return bool(
            self.fix or self.start is not None or self.together or self.apart or self.turntable
        )

    def joined(self, other: "Knowledge") -> "Knowledge":
        """This and another's facts; the other's start poses, if it has any, take precedence."""
        return Knowledge(
            fix=self.fix + other.fix,
            start=self.start if other.start is None else other.start,
            together=self.together + other.together,
            apart=self.apart + other.apart,
            turntable=self.turntable or other.turntable,
        )

    def check_names(self, names: Collection[str]) -> None:
        """Refuse what cannot be about these scans.

        Raises:
            KnowledgeError: If a scan is named that is not there, or no start pose is of any scan.
        """
        for key, named in (
            ("fix", self.fix),
            ("together", [name for pair in self.together for name in pair]),
            ("apart", [name for pair in self.apart for name in pair]),
        ):
            if unknown := [name for name in named if name not in names]:
                there = ", ".join(sorted(names, key=natural_key)[:5])
                raise KnowledgeError(f"{key}: no scan is called {unknown[0]}; there are {there}")
        if self.start is not None and not set(self.start.poses) & set(names):
            raise KnowledgeError(
                "start: has a pose for none of the scans; give poses by their names"
            )

    def by_index(self, prepared: Sequence[PreparedScan]) -> IndexedKnowledge:
        """The facts about the scans that take part, by their index."""
        index = {scan.name: k for k, scan in enumerate(prepared)}
        given = self.start.poses if self.start is not None else {}
        return IndexedKnowledge(
            fixed={index[n]: given.get(n, Pose.identity()) for n in self.fix if n in index},
            starts=self._starts(prepared, index),
            together=_edges(self.together, index),
            apart=_edges(self.apart, index),
            turntable=self.turntable,
        )

    def _starts(
        self, prepared: Sequence[PreparedScan], index: dict[str, int]
    ) -> dict[tuple[int, int], Pose]:
        """Start poses between the sensors of all pairs that share a frame in the file.

        Where none are given, those that the scans' own files have: they are tried, not reported.
        """
        starts = {}
        told = {scan.name: scan.scan.world_from_scan for scan in prepared}
        own = {name: pose for name, pose in told.items() if pose is not None}
        poses = self.start.poses if self.start is not None else own
        are_apart = any(pose.angle_deg() > 0 or pose.translation.any() for pose in own.values())
        for component in self.start.components if self.start is not None else [own] * are_apart:
            there = sorted(index[name] for name in component if name in index)
            sensors = {k: poses[prepared[k].name] @ prepared[k].scan_from_sensor for k in there}
            for i, j in combinations(there, 2):
                starts[i, j] = sensors[i].inverse() @ sensors[j]
        return starts


def _in_order(key: str, pairs: Sequence[Pair]) -> tuple[Pair, ...]:
    """Each pair once, its names in order."""
    for i, j in pairs:
        if i == j:
            raise KnowledgeError(f"{key}: {i} is named twice; name two scans")
    return tuple(dict.fromkeys((i, j) if i < j else (j, i) for i, j in pairs))


def _edges(pairs: Sequence[Pair], index: dict[str, int]) -> frozenset[tuple[int, int]]:
    """Pairs of scans that take part, as i < j."""
    known = [(index[i], index[j]) for i, j in pairs if i in index and j in index]
    return frozenset((min(pair), max(pair)) for pair in known)


class _File(Section):
    """A file of facts."""

    fix: tuple[str, ...] = ()
    start: str | None = None
    together: tuple[Pair, ...] = ()
    apart: tuple[Pair, ...] = ()
    turntable: bool = False


def read_knowledge(path: Path | str) -> Knowledge:
    """Read facts from a JSON file with the keys of ``Knowledge``, all optional.

    ``together`` and ``apart`` are lists of pairs of names, ``start`` is the path of a file of
    poses, relative to the file.

    Raises:
        KnowledgeError: If it cannot be read, or says something that is no fact.
        ReadError: If the file of poses cannot be read.
    """
    path = Path(path)
    try:
        told = _File.model_validate(json.loads(path.read_text(encoding="utf-8")))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        wrong = "no such fact" if first["type"] == "extra_forbidden" else first["msg"]
        raise KnowledgeError(f"{path}: {where}: {wrong}; correct it") from error
    except OSError as error:
        reason = error.strerror or "no such file"
        raise KnowledgeError(f"{path}: {reason}; name a JSON file that can be read") from error
    except (ValueError, RecursionError) as error:
        raise KnowledgeError(f"{path}: cannot be read as JSON ({error}); correct it") from error
    facts = Knowledge(
        fix=told.fix, together=told.together, apart=told.apart, turntable=told.turntable
    )
    return (
        facts if told.start is None else replace(facts, start=read_poses(path.parent / told.start))
    )
