"""Learn to run a depth camera: whole frames and its intrinsics, or frames with masks of the object.

The camera stands still and the object is turned on a table. Frames that show all of that are cut to
what moved; where masks are given they say what is the object.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

import scanweld
from scanweld.evaluation.turntable import CAMERA, EXACT, turntable


def write_frames(folder: Path) -> None:
    """Depth images in millimetres, a mask for each, and the camera in a text file."""
    shots = turntable(scanweld.creature(voxels=70), (0, 30, 60, 90), sensor=EXACT)
    for name in ("depth", "masks"):
        (folder / name).mkdir()
    for scan, mask in zip(shots.scans, shots.masks, strict=True):
        assert scan.grid is not None
        depth = np.where(scan.grid >= 0, 1000 * scan.points[scan.grid, 2], 0)
        Image.fromarray(np.rint(depth).astype(np.uint16)).save(folder / f"depth/{scan.name}.png")
        Image.fromarray(mask).save(folder / f"masks/{scan.name}.png")
    numbers = (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy, CAMERA.width, CAMERA.height)
    (folder / "camera.txt").write_text(" ".join(map(str, numbers)))


def run_frames(folder: Path) -> None:
    """Register whole frames; then read the same with masks."""
    camera = scanweld.DepthOptions(intrinsics=folder / "camera.txt")
    frames = scanweld.read_scans(folder / "depth", camera)
    result = scanweld.run(frames)
    print(f"{result.verdict}: {len(result.poses)} of {len(frames)} frames are placed")
    for name, report in result.scans.items():
        print(f"{name}: {report.notes[-1]}")

    masks = scanweld.DepthOptions(intrinsics=folder / "camera.txt", masks=folder / "masks")
    for scan in scanweld.read_scans(folder / "depth", masks):
        print(f"{scan.name} by its mask: {len(scan.points)} points")


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        write_frames(Path(folder))
        run_frames(Path(folder))
