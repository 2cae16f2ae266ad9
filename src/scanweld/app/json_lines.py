"""Events as JSON, one object a line: what ``--json`` prints."""

import json
from dataclasses import asdict
from pathlib import Path

from scanweld.reconstruction import Reconstruction
from scanweld.work.progress import Event, ScanRefused, StageAdvanced, StageFinished, StageStarted

EVENTS: dict[type[Event], str] = {
    StageStarted: "stage_started",
    StageAdvanced: "stage_advanced",
    StageFinished: "stage_finished",
    ScanRefused: "scan_refused",
}
"""How each kind of event is called; the last one of a run is ``finished``."""


def event_line(event: Event) -> str:
    """An event of the library."""
    return json.dumps({"event": EVENTS[type(event)], **asdict(event)})


def finished_line(result: Reconstruction, output: Path) -> str:
    """The end: the verdict, and where everything is."""
    content = {
        "event": "finished",
        "verdict": result.verdict.value,
        "exit_code": result.verdict.exit_code,
        "reasons": list(result.reasons),
        "scans": len(result.scans),
        "placed": len(result.poses),
        "components": len(result.components),
        "faces": None if result.mesh is None else len(result.mesh.faces),
        "output": str(output),
    }
    return json.dumps(content)
