"""scanweld: unordered range scans of an object to one registered, fused model and a verdict.

In short: ``scanweld.run(scanweld.read_scans("scans/"))``. One stage alone: ``prepare``,
``register_pair``, ``refine``, ``fuse``, ``evaluate``.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scanweld.config import Config, load_config
    from scanweld.errors import (
        ConfigError,
        InputError,
        KnowledgeError,
        ReadError,
        ScanweldError,
        WriteError,
    )
    from scanweld.evaluation.comparison import comparison_table
    from scanweld.evaluation.creature import creature
    from scanweld.evaluation.metrics import PoseErrors, evaluate
    from scanweld.evaluation.simulate import simulate
    from scanweld.evidence.evidence import Evidence
    from scanweld.geometry.camera import Camera, CameraModel
    from scanweld.geometry.mesh import TriangleMesh
    from scanweld.geometry.pose import Pose
    from scanweld.geometry.prepared import PreparedScan
    from scanweld.geometry.scan import RangeScan, Viewpoint
    from scanweld.io import (
        PoseSet,
        read_mesh,
        read_poses,
        read_scan,
        write_mesh_ply,
        write_poses,
        write_scan_ply,
    )
    from scanweld.io.depth.capture import DepthOptions
    from scanweld.io.scans import read_scans
    from scanweld.knowledge.facts import Knowledge, read_knowledge
    from scanweld.pairs.result import PairKind
    from scanweld.pipeline.one_stage import fuse, prepare, refine, register_pair
    from scanweld.pipeline.run import run
    from scanweld.preparation.info import describe_scan
    from scanweld.reconstruction import (
        FactReport,
        FactVerdict,
        PairReport,
        Reconstruction,
        ScanReport,
        ScanVerdict,
        Verdict,
    )
    from scanweld.work.progress import (
        Event,
        ScanRefused,
        StageAdvanced,
        StageFinished,
        StageStarted,
    )

    __version__: str

__all__ = [
    "Camera",
    "CameraModel",
    "Config",
    "ConfigError",
    "DepthOptions",
    "Event",
    "Evidence",
    "FactReport",
    "FactVerdict",
    "InputError",
    "Knowledge",
    "KnowledgeError",
    "PairKind",
    "PairReport",
    "Pose",
    "PoseErrors",
    "PoseSet",
    "PreparedScan",
    "RangeScan",
    "ReadError",
    "Reconstruction",
    "ScanRefused",
    "ScanReport",
    "ScanVerdict",
    "ScanweldError",
    "StageAdvanced",
    "StageFinished",
    "StageStarted",
    "TriangleMesh",
    "Verdict",
    "Viewpoint",
    "WriteError",
    "comparison_table",
    "creature",
    "describe_scan",
    "evaluate",
    "fuse",
    "load_config",
    "prepare",
    "read_knowledge",
    "read_mesh",
    "read_poses",
    "read_scan",
    "read_scans",
    "refine",
    "register_pair",
    "run",
    "simulate",
    "write_mesh_ply",
    "write_poses",
    "write_scan_ply",
]

_MODULES = {
    "config": "Config load_config",
    "errors": "ConfigError InputError KnowledgeError ReadError ScanweldError WriteError",
    "evaluation.comparison": "comparison_table",
    "evaluation.creature": "creature",
    "evaluation.metrics": "PoseErrors evaluate",
    "evaluation.simulate": "simulate",
    "evidence.evidence": "Evidence",
    "geometry.camera": "Camera CameraModel",
    "geometry.mesh": "TriangleMesh",
    "geometry.pose": "Pose",
    "geometry.prepared": "PreparedScan",
    "geometry.scan": "RangeScan Viewpoint",
    "io": "PoseSet read_mesh read_poses read_scan write_mesh_ply write_poses write_scan_ply",
    "io.depth.capture": "DepthOptions",
    "io.scans": "read_scans",
    "knowledge.facts": "Knowledge read_knowledge",
    "pairs.result": "PairKind",
    "pipeline.one_stage": "fuse prepare refine register_pair",
    "pipeline.run": "run",
    "preparation.info": "describe_scan",
    "reconstruction": "FactReport FactVerdict PairReport Reconstruction ScanReport ScanVerdict "
    "Verdict",
    "work.progress": "Event ScanRefused StageAdvanced StageFinished StageStarted",
}
"""Module -> what it holds of the above: imported when it is first asked for, as all of it takes a
second, of which the command line often needs little."""


def __getattr__(name: str) -> Any:
    """What is public, from its module (PEP 562)."""
    if name == "__version__":
        from importlib.metadata import version

        return version("scanweld")
    for module, names in _MODULES.items():
        if name in names.split():
            found = globals()[name] = getattr(import_module(f"scanweld.{module}"), name)
            return found
    raise AttributeError(f"module 'scanweld' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
