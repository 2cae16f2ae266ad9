"""Profiles of solids about an axis: vases and gears, whole or with one mark."""

from collections.abc import Callable

import numpy as np

from scanweld.geometry.arrays import FloatArray

KNOB_WIDTH, KNOB_HEIGHT = 7.0, 4.0
"""Of the knob on a vase, in hundredths of the vase's height."""
TOOTH_HEIGHT = 6.0
"""Half of a tooth's, in hundredths of twice the gear's radius."""

Profile = Callable[[FloatArray, FloatArray], FloatArray]
"""Radius by turn (radians) and level (0 at the bottom, 1 at the top)."""


def vase_radius(rng: np.random.Generator) -> Profile:
    """A belly, a neck and a lip, wider or slimmer."""
    width, waves = rng.uniform(19.0, 25.0), rng.uniform(2.4, 2.8)

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        return width + 12.0 * np.sin(waves * np.pi * level + 0.3) - 4.0 * level + 0.0 * turn

    return radius


def knobbed(plain: Profile) -> Profile:
    """The same with one knob on the belly."""
    belly = float(plain(np.zeros(1), np.full(1, 0.3))[0])

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        around = belly * np.angle(np.exp(1j * (turn - 1.0)))
        away2 = around**2 + (100.0 * (level - 0.3)) ** 2
        return plain(turn, level) + KNOB_HEIGHT * np.exp(-away2 / (2 * (KNOB_WIDTH / 2.4) ** 2))

    return radius


def gear_radius(rng: np.random.Generator) -> Profile:
    """Twelve teeth."""
    size = rng.uniform(38.0, 50.0)

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        return size + TOOTH_HEIGHT * np.tanh(4.0 * np.cos(12.0 * turn)) + 0.0 * level

    return radius


def keyed(plain: Profile) -> Profile:
    """The same with one tooth that is worn to half its height over its upper half."""

    def radius(turn: FloatArray, level: FloatArray) -> FloatArray:
        worn = np.abs(np.angle(np.exp(1j * turn))) < np.pi / 14
        return plain(turn, level) - np.where(worn & (level > 0.5), TOOTH_HEIGHT, 0.0)

    return radius
