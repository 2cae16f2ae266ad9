"""Bodies that are nearly symmetric, scanned from two sides and turned about their axis."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from scanweld.evaluation.primitives import lathe
from scanweld.evaluation.scanner import NoiseModel
from scanweld.evaluation.views import view_of
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose, rotation_exp
from scanweld.pairs.anchors import even_anchors
from scanweld.pairs.register import register_pair
from scanweld.pairs.result import PairResult
from tests.prepared import PreparedPair, pair_of_scene
from tests.scenes import scene_of

Radius = Callable[[FloatArray, FloatArray], FloatArray]
"""Radius by turn (radians) and level (0 to 1)."""


def gear(turn: FloatArray, level: FloatArray) -> FloatArray:
    return 44.0 + 6.0 * np.tanh(4.0 * np.cos(8 * turn)) + 0.0 * level


def worn(turn: FloatArray, level: FloatArray) -> FloatArray:
    """The upper half of one tooth is gone."""
    is_worn = np.abs(np.angle(np.exp(1j * (turn - np.pi / 4)))) < np.pi / 10
    return gear(turn, level) - np.where(is_worn & (level > 0.5), 6.0, 0.0)


def toothless(turn: FloatArray, level: FloatArray) -> FloatArray:
    """The tooth at 0 is gone from top to bottom."""
    return np.where(np.abs(np.angle(np.exp(1j * turn))) < np.pi / 10, 38.0, gear(turn, level))


def unequal(turn: FloatArray, level: FloatArray) -> FloatArray:
    """Every other tooth is lower."""
    return gear(turn, level) - np.where(np.cos(8 * turn) > 0, 4.0 * (np.cos(4 * turn) < 0), 0.0)


def star(turn: FloatArray, level: FloatArray) -> FloatArray:
    return 30.0 + 8.0 * np.cos(5 * turn) + 0.0 * level


def vase(turn: FloatArray, level: FloatArray) -> FloatArray:
    return 24.0 + 10.0 * np.sin(2.5 * np.pi * level + 0.3) - 4.0 * level + 0.0 * turn


def knobbed(turn: FloatArray, level: FloatArray) -> FloatArray:
    """A vase with one knob."""
    away2 = (30.0 * (turn - 0.5)) ** 2 + (100.0 * (level - 0.3)) ** 2
    return vase(turn, level) + 4.0 * np.exp(-away2 / 17.0)


@lru_cache
def lathed(radius: Radius, height: float = 100.0) -> TriangleMesh:
    return lathe(radius, height)


@lru_cache
def seen_twice(
    mesh: TriangleMesh,
    gap_deg: float,
    elevation_deg: float,
    noise: NoiseModel,
    *,
    azimuth_deg: float = 0.0,
    rolls_deg: tuple[float, float] = (20.0, 20.0),
    pixels: float = 200.0,
) -> PreparedPair:
    """Two scans of a mesh, the second from farther around."""
    views = [
        view_of(mesh, azimuth_deg + gap_deg * k, elevation_deg, roll, pixels=pixels)
        for k, roll in enumerate(rolls_deg)
    ]
    return pair_of_scene(scene_of(mesh, views, noise=noise), 0, 1)


def turned(pair: PreparedPair, degrees: float) -> Pose:
    """The true pose with j's object turned about its axis, that of the motion between the views.

    The sensors look at the middle of the object from one elevation with one roll, so that a turn
    about its axis takes one to the other.
    """
    motion = pair.i_from_j
    angles, vectors = np.linalg.eig(motion.rotation)
    axis = np.real(vectors[:, int(np.argmin(np.abs(angles - 1.0)))])
    point = np.linalg.lstsq(np.eye(3) - motion.rotation, motion.translation, rcond=1e-6)[0]
    turn = rotation_exp(np.radians(degrees) * axis)
    return motion @ Pose(rotation=turn, translation=point - turn @ point)


def registered(pair: PreparedPair) -> PairResult:
    """By anchors that are spread evenly, whatever the surface is like."""
    problem = pair.problem()
    a, b = (even_anchors(field, problem.config.num_anchors) for field in pair.fields)
    return register_pair(problem, [(a, b)])
