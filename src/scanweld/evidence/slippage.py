"""Which way a pair can slide: the motions that its information leaves free, by name.

Motions under which a surface stays on itself are the small eigenvectors of the point-to-plane
information (Gelfand & Guibas, "Shape segmentation using local slippage analysis", 2004). Only a few
kinds of surface have any, and the number of free translations and rotations tells which.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from scanweld.geometry.arrays import FloatArray, frozen
from scanweld.geometry.gauss_newton import TURN_SCALE

FAR_DIAMETERS = 2.0
"""A turn about an axis farther than this from the matches is as good as a shift."""
FLAT_DIAMETERS = 0.03
"""A turn that advances by less than this per radian along its axis is no screw."""


class Slide(StrEnum):
    """Surfaces that slide on themselves."""

    PLANE = "plane"
    SPHERE = "sphere"
    CYLINDER = "cylinder"
    REVOLUTION = "surface of revolution"
    EXTRUSION = "extrusion"
    HELIX = "helix"
    MANY = "several ways"
    """More than these: little surface is shared, or noise drowns it."""


_WORDS = {
    Slide.PLANE: "like a plane: free to shift in it and to turn about its normal",
    Slide.SPHERE: "like a sphere: free to turn any way about its middle",
    Slide.CYLINDER: "like a cylinder: free to turn about an axis and to shift along it",
    Slide.REVOLUTION: "like a surface of revolution: free to turn about an axis",
    Slide.EXTRUSION: "like an extrusion: free to shift along an axis",
    Slide.HELIX: "like a helix: free to turn about an axis while shifting along it",
    Slide.MANY: "in several ways",
}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Slippage:
    """What motion of a pair is free.

    Attributes:
        slide: The surface that slides like this.
        axis: (3,) unit vector in the first scan's sensor frame, of the turn or the shift, or the
            normal of a plane. None for a sphere, or several ways.
        point: (3,) point of the turn's axis nearest to the middle of the matches, or the middle of
            the sphere, seen from the middle of the matches and in diameters. None for the others.
    """

    slide: Slide
    axis: FloatArray | None
    point: FloatArray | None

    def __post_init__(self) -> None:
        for name in ("axis", "point"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen(value, np.float64, (3,)))


def slide_words(slide: Slide) -> str:
    """How surfaces slide, in words."""
    return _WORDS[slide]


def slippage_of(information: FloatArray, min_observability: float) -> Slippage | None:
    """The free motion that the information (6, 6) of a pose leaves; None if it leaves none.

    Args:
        information: As ``information_of`` gives it.
        min_observability: Free is what has an eigenvalue below this share of the largest.
    """
    free = free_motions(information, min_observability)
    return _named(free.T) if len(free) else None


def free_motions(information: FloatArray, min_observability: float) -> FloatArray:
    """The orthonormal motions (K, 6) that an information (6, 6) leaves free, the freest first."""
    eigenvalues, vectors = np.linalg.eigh(information)
    largest = max(eigenvalues[-1], np.finfo(float).tiny)
    num_free = int((np.maximum(eigenvalues, 0.0) < min_observability * largest).sum())
    return vectors[:, :num_free].T


def _named(free: FloatArray) -> Slippage:
    """The surface that slides by free motions (6, K), orthonormal and with rotations scaled."""
    _, _, combination = np.linalg.svd(free[:3])
    motions = (free @ combination.T).T  # those that turn most come first
    turn, shift = TURN_SCALE * motions[:, :3], motions[:, 3:]
    is_turn = np.linalg.norm(turn, axis=1) * FAR_DIAMETERS > np.linalg.norm(shift, axis=1)
    # The numbers of free turns and shifts: only these come together on a surface.
    match int(is_turn.sum()), int((~is_turn).sum()):
        case 1, 0:
            return _about_axis(Slide.REVOLUTION, turn[0], shift[0])
        case 0, 1:
            return Slippage(slide=Slide.EXTRUSION, axis=_unit(shift[0]), point=None)
        case 1, 1:
            return _about_axis(Slide.CYLINDER, turn[0], shift[0])
        case ((2 | 3), 0):
            return Slippage(slide=Slide.SPHERE, axis=None, point=_fixed_point(turn, shift))
        case ((0 | 1), 2):
            normal = np.cross(shift[-1], shift[-2])
            return Slippage(slide=Slide.PLANE, axis=_unit(normal), point=None)
        case _:
            return Slippage(slide=Slide.MANY, axis=None, point=None)


def _about_axis(slide: Slide, turn: FloatArray, shift: FloatArray) -> Slippage:
    """A turn, whose twist (turn, shift) gives its axis and how far it advances."""
    square = float(turn @ turn)
    advance = abs(float(turn @ shift)) / square
    if slide is Slide.REVOLUTION and advance > FLAT_DIAMETERS:
        slide = Slide.HELIX
    return Slippage(slide=slide, axis=_unit(turn), point=np.cross(turn, shift) / square)


def _fixed_point(turns: FloatArray, shifts: FloatArray) -> FloatArray:
    """The point (3,) that turns (K, 3) with shifts (K, 3) of the origin move least."""
    x, y, z = turns.T
    zero = np.zeros_like(x)
    crossed = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3)
    return np.linalg.lstsq(crossed, -shifts.ravel(), rcond=None)[0].astype(np.float64)


def _unit(axis: FloatArray) -> FloatArray:
    """The direction of an axis, its largest component positive."""
    return axis / np.linalg.norm(axis) * np.sign(axis[np.argmax(np.abs(axis))])
