"""Pictures of the model that need no script."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scanweld.app.html_report.orientation import Orientation
from scanweld.app.html_report.style import STYLE
from scanweld.geometry.arrays import ByteArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.shading import Side, png_bytes, seen_from
from scanweld.work.threads import map_in_order

AROUND = ("the front", "the right", "the left")
FACES = ("the front", "behind", "below")
"""Sides from which the model is shown, the first three a third of a turn apart."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Still:
    """A picture as a data address, with the words for those who cannot see it."""

    address: str
    alt: str
    width: int
    height: int


def sides_of(mesh: TriangleMesh, orientation: Orientation, workers: int = 1) -> dict[str, Side]:
    """The model from all sides, as the reference scan's sensor is the front."""
    front, up = orientation.front, orientation.up
    views = {
        "the front": (front, up),
        "the right": (orientation.turned(120.0), up),
        "the left": (orientation.turned(240.0), up),
        "behind": (-front, up),
        "below": (-up, front),
    }
    size = STYLE.still_pixels
    sides = map_in_order(lambda view: seen_from(mesh, *view, size), [*views.values()], workers)
    return dict(zip(views, sides, strict=True))


def stills(
    sides: Mapping[str, Side],
    names: Sequence[str],
    colors: ByteArray | None,
    what: str,
    workers: int = 1,
) -> list[Still]:
    """Pictures from some of the sides, in colours (V, 3)."""

    def still(name: str) -> Still:
        return still_of(sides[name].cutout(colors), f"{what} {name}")

    return [*map_in_order(still, names, workers)]


def still_of(picture: ByteArray, alt: str) -> Still:
    """A picture (H, W, 3 or 4) with the words for those who cannot see it."""
    address = "data:image/png;base64," + base64.b64encode(png_bytes(picture)).decode("ascii")
    return Still(address=address, alt=alt, width=picture.shape[1], height=picture.shape[0])
