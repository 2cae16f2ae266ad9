"""The depth images that a user names, with what the layout of their capture knows of them."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from scanweld.errors import InputError
from scanweld.io.depth.images import check_colors, depth_images, num_colors
from scanweld.io.depth.intrinsics import Intrinsics
from scanweld.io.depth.layouts.records import Layout, Shot
from scanweld.io.depth.layouts.registry import layout_of


@dataclass(frozen=True, kw_only=True, slots=True)
class Shots:
    """Depth images.

    Attributes:
        shots: In natural order of their paths.
        layout: Of their capture, if it has a known one.
        folder: Of the capture, if it was named as a whole.
    """

    shots: tuple[Shot, ...]
    layout: Layout | None = None
    folder: Path | None = None

    @property
    def title(self) -> str:
        """Who tells what is known of all."""
        return "" if self.layout is None else f"the layout of {self.layout.name}"

    @property
    def per_meter(self) -> float | None:
        """Depth values in a metre, as the layout says."""
        return None if self.layout is None else self.layout.per_meter

    @property
    def usual(self) -> Intrinsics | None:
        """Intrinsics for images that no file has any of."""
        return None if self.layout is None else self.layout.usual

    @property
    def is_color_scaled(self) -> bool:
        """Whether colour images may show the same view in another size."""
        return self.layout is not None and self.layout.is_scaled

    def told_of(self, shot: Shot, intrinsics: Intrinsics) -> tuple[str, ...]:
        """What is to be said of an image: its layout, its camera, whether a pose of it is tried."""
        if self.layout is None:
            return shot.notes
        pose = "without a pose"
        if shot.world_from_camera is not None:
            pose = f"with a pose ({self.layout.poses}), which is tried and never just believed"
        told = (f"{self.layout.name} layout, {pose.replace('`', '')}", *shot.notes)
        if intrinsics is not self.layout.usual:
            return told
        return (*told, f"no file of intrinsics: those usual for {self.layout.name} are taken")

    def check_colors(self) -> None:
        """Refuse a capture in which some images have a colour image and some not.

        Raises:
            InputError: If that is so, or there are more colour than depth images.
        """
        colors = {shot.depth: shot.color for shot in self.shots if shot.color is not None}
        if self.layout is None or self.folder is None or not self.layout.color_folders:
            return
        paths = [shot.depth for shot in self.shots]
        count = num_colors(self.folder, self.layout.color_folders)
        if count and count != len(paths):
            raise InputError(
                f"{self.folder}: {count} colour images for {len(paths)} depth images: which belong "
                "together is not known; take the others away, or give --color none"
            )
        if count:
            check_colors(self.folder, paths, colors)


def shots_of(inputs: Sequence[Path | str]) -> Shots:
    """The images that are named, or those of a capture that is named by its folder.

    Raises:
        ReadError: If a file is missing, no depth image, or the layout's files are broken.
        InputError: If there are none, or files of several layouts.
    """
    if len(inputs) == 1 and (folder := Path(inputs[0])).is_dir() and (found := _read(folder)):
        if not found.shots:
            raise InputError(f"{folder}: holds no depth images, though it has a layout of them")
        return found
    paths = depth_images(inputs)
    for folder in dict.fromkeys((paths[0].parent, paths[0].parent.parent)):
        found = _read(folder)
        known = {} if found is None else {os.path.abspath(s.depth): s for s in found.shots}
        if found is not None and all(os.path.abspath(path) in known for path in paths):
            shots = tuple(known[os.path.abspath(path)] for path in paths)
            return Shots(shots=shots, layout=found.layout)
    return Shots(shots=tuple(Shot(depth=path) for path in paths))


def _read(folder: Path) -> Shots | None:
    layout = layout_of(folder)
    if layout is None:
        return None
    return Shots(shots=_without_one_pose(layout.read(folder)), layout=layout, folder=folder)


def _without_one_pose(shots: Sequence[Shot]) -> tuple[Shot, ...]:
    """The images without their poses, if all are the same: a camera that stood tells nothing."""
    poses = [s.world_from_camera.matrix() for s in shots if s.world_from_camera is not None]
    if len(poses) < 2 or any((pose != poses[0]).any() for pose in poses):
        return tuple(shots)
    note = "all poses of the capture are the same: they are not used"
    return tuple(replace(s, world_from_camera=None, notes=(*s.notes, note)) for s in shots)
