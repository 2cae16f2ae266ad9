"""Learn what a capture is: a folder whose layout is known, with colours and poses of the camera.

A capture needs no options. Its poses are tried as starts and judged like all others.
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

import scanweld
from scanweld.evaluation.turntable import CAMERA, EXACT, turntable


def write_capture(folder: Path) -> None:
    """The layout of Open3D: depth, color, camera_intrinsic.json and trajectory.log."""
    shots = turntable(scanweld.creature(voxels=70), (0, 30), sensor=EXACT)
    for name in ("depth", "color"):
        (folder / name).mkdir()
    lines = []
    for k, (scan, pose) in enumerate(zip(shots.scans, shots.object_from_sensor, strict=True)):
        assert scan.grid is not None
        depth = np.where(scan.grid >= 0, 1000 * scan.points[scan.grid, 2], 0)
        Image.fromarray(np.rint(depth).astype(np.uint16)).save(folder / f"depth/{scan.name}.png")
        brown = np.full((*depth.shape, 3), (150, 110, 80), np.uint8)
        Image.fromarray(brown).save(folder / f"color/{scan.name}.jpg")
        lines += [f"{k} {k} {k + 1}", *(" ".join(map(str, row)) for row in pose.matrix())]
    (folder / "trajectory.log").write_text("\n".join(lines))
    matrix = [CAMERA.fx, 0, 0, 0, CAMERA.fy, 0, CAMERA.cx, CAMERA.cy, 1]  # column after column
    told = {"width": CAMERA.width, "height": CAMERA.height, "intrinsic_matrix": matrix}
    (folder / "camera_intrinsic.json").write_text(json.dumps(told))


def show_capture(folder: Path) -> None:
    """Read the capture, as ``scanweld run`` and ``scanweld info`` do."""
    for scan in scanweld.read_scans(folder):
        print(f"{scan.name}: {'with' if scan.colors is not None else 'without'} colours")
        for note in scan.notes:
            print(f"    {note}")


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        write_capture(Path(folder))
        show_capture(Path(folder))
