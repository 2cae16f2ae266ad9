"""Draw frames of a turntable, with what is kept of them in green.

python docs/depth_picture.py docs/depth-frames.png
"""

import sys
from dataclasses import replace
from pathlib import Path

from scanweld.app.html_report.cut_pictures import picture_of
from scanweld.cut import cut_out
from scanweld.evaluation.creature import creature
from scanweld.evaluation.turntable import CAMERA, D435, turntable
from scanweld.geometry.shading import side_by_side, write_png

TURNS_DEG = (0.0, 40.0, 80.0)


def draw(picture: Path) -> None:
    """Render the frames, cut them, and put them side by side."""
    camera = replace(CAMERA, width=640, height=480, fx=600, fy=600, cx=319.5, cy=239.5)
    shots = turntable(creature(voxels=120), TURNS_DEG, sensor=D435, camera=camera)
    kept = cut_out(shots.scans, "moving").kept
    write_png(picture, side_by_side([picture_of(scan, kept[scan.name]) for scan in shots.scans]))


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
