"""report.json and graph.json as they are read back."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from scanweld.errors import ReadError
from scanweld.evidence.evidence import Evidence
from scanweld.io.poses import load_json, read_text
from scanweld.pairs.result import PairKind
from scanweld.reconstruction import FactReport, ScanReport, Verdict


class Entry(BaseModel):
    """Part of a file; keys that are not named here are left alone."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class FileEntry(Entry):
    """Where a scan is, as seen from the folder, and the hash of its content.

    Attributes:
        file: None where it is unknown.
        part: Which of the file's scans it is, from 0.
        content_hash: Of the scan, after the cut; None if it could not be read.
        kept: What the cut kept, as ``ScanReport`` has it.
    """

    file: str | None = None
    part: int = 0
    content_hash: str | None = None
    kept: str | None = None


class Files(Entry):
    """What report.json says of where the scans are, and how they were read."""

    scans: dict[str, FileEntry]
    max_points: int | None = None


class StageEntry(Entry):
    """A stage in report.json; what it counted is kept as extra keys."""

    model_config = ConfigDict(frozen=True, extra="allow")
    seconds: float
    peak_mb: float

    @property
    def counts(self) -> Mapping[str, Any]:
        """What the stage counted, by name."""
        return self.model_extra or {}


class SensorEntry(Entry):
    """What report.json says of the sensor, in a sentence, and how far surfaces lie apart."""

    words: str
    sigma: float = 0.0
    spread: tuple[int, ...] = ()


class Report(Entry):
    """report.json."""

    format: Literal[1]
    verdict: Verdict
    reasons: tuple[str, ...]
    knowledge: tuple[FactReport, ...] = ()
    sensor: SensorEntry | None = None
    scans: dict[str, ScanReport]
    stages: dict[str, StageEntry]
    settings: dict[str, Any]


class PairEntry(Entry):
    """A pair in graph.json."""

    i: str
    j: str
    kind: PairKind
    accepted: bool
    reason: str
    score: float | None
    overlap: float
    evidence: Evidence | None
    margin: float | None
    observability: float | None
    sliding: str | None = None
    confidence: float | None = None


class Graph(Entry):
    """graph.json."""

    format: Literal[1]
    pairs: tuple[PairEntry, ...]


Content = TypeVar("Content", bound=Entry)


def read_entries(path: Path, kind: type[Content]) -> Content:
    """Read one of the files.

    Raises:
        ReadError: If it is missing, broken, or does not say what it should.
    """
    if not path.is_file():
        raise ReadError(f"{path}: is missing; name a folder that scanweld run or fuse has made")
    content = load_json(path, read_text(path))
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole"
        raise ReadError(
            f"{path}: {where}: {first['msg'].lower()}; run scanweld again to write it anew"
        ) from error
