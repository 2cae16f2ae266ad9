"""Learn the whole job in Python: scans in, poses and a model out, and how far to trust them."""

from pathlib import Path
from tempfile import TemporaryDirectory

import scanweld


def run_rendered(folder: Path) -> None:
    """Scan a creature from six sides, then register and fuse the scans."""
    scanweld.simulate(scanweld.creature(voxels=70), folder / "scans", num_scans=6, pixels=160)

    scans = scanweld.read_scans(folder / "scans")
    result = scanweld.run(scans)

    print(f"{result.verdict}: {len(result.poses)} of {len(scans)} scans are placed")
    for name, pose in result.poses.items():
        print(f"{name}: turned by {pose.angle_deg():.1f} deg against the reference scan")
    for name, reason in result.unplaced.items():
        print(f"{name} has no pose: {reason}")
    if result.mesh is not None:
        scanweld.write_mesh_ply(folder / "model.ply", result.mesh)
        print(f"model.ply: {len(result.mesh.faces)} faces")


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        run_rendered(Path(folder))
