"""Learn to fuse scans whose poses are known already, from a turntable or a robot, say."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import scanweld
from scanweld.evaluation.creature import creature
from scanweld.evaluation.simulate import simulate
from scanweld.fusion import fuse
from scanweld.preparation import prepare


def fuse_posed(
    scans: Sequence[scanweld.RangeScan], world_from_scan: Mapping[str, scanweld.Pose]
) -> scanweld.TriangleMesh:
    """One mesh of all scans, in the world frame."""
    config = scanweld.Config()
    prepared = [prepare(scan, config.prepare) for scan in scans]
    # Stages after preparation work in the sensor's frame; where it stood is known by then.
    poses = [world_from_scan[each.name] @ each.scan_from_sensor for each in prepared]
    return fuse(prepared, poses, config.fusion)


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        simulate(creature(voxels=70), Path(folder) / "scans", num_scans=6, pixels=140)
        poses = scanweld.read_poses(Path(folder) / "scans/truth/poses.json").poses
        mesh = fuse_posed(scanweld.read_scans(Path(folder) / "scans"), poses)
        print(f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces")
