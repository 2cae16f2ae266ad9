"""Learn to fuse scans whose poses are known already, from a turntable or a robot, say."""

from pathlib import Path
from tempfile import TemporaryDirectory

import scanweld

if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        scanweld.simulate(
            scanweld.creature(voxels=70), Path(folder) / "scans", num_scans=6, pixels=140
        )
        poses = scanweld.read_poses(Path(folder) / "scans/truth/poses.json").poses
        mesh = scanweld.fuse(scanweld.read_scans(Path(folder) / "scans"), poses)
        print(f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces")
