"""docs/method.md: its template, and what that asks of the records of all benchmarks."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blocks import TEMPLATES
from benchmarks.paper import ablations, settings, summary
from benchmarks.paper import ablations_search as search
from benchmarks.results import DATA, read_results
from benchmarks.scores import Stated
from benchmarks.study.records import Records, results
from benchmarks.study.study import measured_by, read_records
from scanweld.config import Config
from scanweld.evidence.evidence import Evidence
from scanweld.io.atomic import write_whole
from scanweld.pairs.problem import schedules

TEMPLATE = "method_template.md"


def write_method(folder: Path) -> None:
    """Write method.md beside the folder of the study's pages."""
    write_whole(folder.parent / "method.md", method_text(folder).encode())


def method_text(folder: Path, others: Path = DATA) -> str:
    """The page, of the study in a folder and the records of the other benchmarks in another."""

    def study(name: str) -> Records:
        with measured_by(f"python -m benchmarks.paper --only {name}"):
            return read_records(folder, name)

    def other(name: str) -> list[Mapping[str, Any]]:
        with measured_by("make benchmarks"):
            return read_results(others / f"{name}.json")["records"]

    names = {"Config": Config, "parts": ablations, "search": search, "study": study, "other": other}
    names |= {"auc": auc, "middle_share": middle_share, "schedules": schedules(1.0)}
    return TEMPLATES.get_template(TEMPLATE).render(vars(settings) | vars(summary) | names)


def auc(answers: Iterable[Mapping[str, Any]], what: str) -> float:
    """How well a number of the evidence tells right first answers from wrong ones."""
    each = ((getattr(Evidence(**a["evidence"]), what), a["rank"] == 1) for a in answers)
    return Stated.of(each).auc


def middle_share(records: Records, kinds: Iterable[str], is_right: bool) -> float:
    """Median share of evidence of some kinds, over the right or the wrong poses kept."""
    kept = [pose for poses in results(records, "mixed") for pose in poses]
    chosen = [pose for pose in kept if search.RIGHT.holds(pose) is is_right]
    return float(np.median([sum(pose[kind] for kind in kinds) for pose in chosen]))
