"""scanweld: unordered range scans of an object to one registered, fused model and a verdict.

In short: ``scanweld.run(scanweld.read_scans("scans/"))``.
"""

from scanweld import kernels as kernels  # first: makes room for the kernels of the others
from scanweld.config import Config, load_config
from scanweld.errors import (
    ConfigError,
    InputError,
    KnowledgeError,
    ReadError,
    ScanweldError,
    WriteError,
)
from scanweld.evaluation.metrics import evaluate_poses
from scanweld.geometry.camera import Camera, CameraModel
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
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
from scanweld.io.scans import read_scans
from scanweld.knowledge import Knowledge, read_knowledge
from scanweld.pairs.result import Evidence, PairKind
from scanweld.pipeline import run
from scanweld.progress import Event, ScanRefused, StageAdvanced, StageFinished, StageStarted
from scanweld.reconstruction import (
    FactReport,
    FactVerdict,
    PairReport,
    Reconstruction,
    ScanReport,
    ScanVerdict,
    Verdict,
)

__all__ = [
    "Camera",
    "CameraModel",
    "Config",
    "ConfigError",
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
    "PoseSet",
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
    "evaluate_poses",
    "load_config",
    "read_knowledge",
    "read_mesh",
    "read_poses",
    "read_scan",
    "read_scans",
    "run",
    "write_mesh_ply",
    "write_poses",
    "write_scan_ply",
]
