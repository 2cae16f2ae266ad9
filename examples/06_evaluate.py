"""Learn to measure poses against the truth: right, wrong or unplaced, and how far off."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import scanweld


def disturbed(truth: scanweld.PoseSet, seed: int = 0) -> scanweld.PoseSet:
    """Poses in a world of their own, each a little off, one far off, and the last one lost."""
    rng = np.random.default_rng(seed)
    elsewhere = scanweld.Pose.exp([0.3, -1.0, 0.5, 100, 200, -50])
    *placed, lost = truth.poses
    size = np.array([2e-3] * 3 + [0.2] * 3)  # radians, and units of the object's length
    poses = {
        name: elsewhere @ scanweld.Pose.exp(rng.normal(size=6) * size) @ truth.poses[name]
        for name in placed
    }
    poses[placed[0]] = scanweld.Pose.exp([0.1, 0, 0, 5, 0, 0]) @ poses[placed[0]]
    return scanweld.PoseSet(poses=poses, components=(tuple(placed),), unplaced={lost: "example"})


if __name__ == "__main__":
    with TemporaryDirectory() as name:
        folder = Path(name)
        truth = scanweld.simulate(
            scanweld.creature(voxels=70), folder / "scans", num_scans=5, pixels=60
        )
        scans = scanweld.read_scans(folder / "scans")
        errors = scanweld.evaluate(disturbed(truth), truth.poses, scans)
        print(scanweld.comparison_table(errors))
