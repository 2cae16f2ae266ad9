"""How far single depths are off, from the images alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanweld.cut.smoothing import LEAST_NOISE, noise_of, uneven
from scanweld.geometry.arrays import FloatArray


@dataclass(frozen=True, kw_only=True, slots=True)
class DepthNoise:
    """Standard deviation of single depths: sqrt(constant^2 + (quadratic z^2)^2).

    That of triangulation grows with the square of the depth; that of files in whole millimetres and
    of time of flight does not.

    Attributes:
        constant: In metres.
        quadratic: Per metre.
    """

    constant: float
    quadratic: float

    def at(self, depth: FloatArray) -> FloatArray:
        """Of depths of any shape, NaN where they are."""
        return np.hypot(self.constant, self.quadratic * depth**2)

    def halved(self, times: int) -> "DepthNoise":
        """That of means over blocks of two by two pixels, taken so many times."""
        return DepthNoise(constant=self.constant / 2**times, quadratic=self.quadratic / 2**times)

    @property
    def terms(self) -> FloatArray:
        """(2,): constant, quadratic; what compiled kernels take."""
        return np.array([self.constant, self.quadratic])


def depth_noise(images: Sequence[FloatArray]) -> DepthNoise:
    """Noise of depth images (H, W), by how depths differ from the middle of their neighbours."""
    off, depth = zip(*map(uneven, images), strict=True)
    steps = [np.abs(np.diff(image, axis=1)) for image in images]
    away, far = np.concatenate(off), np.concatenate(depth)
    step = np.concatenate([each[each > 0] for each in steps])  # False where one is NaN
    if not len(away):
        return DepthNoise(constant=LEAST_NOISE, quadratic=0.0)
    # An even error within a step of the sensor; as often as not neighbours do not show it.
    quantum = float(step.min()) / np.sqrt(12.0) if len(step) else 0.0
    found = noise_of(away, far)
    squares = np.stack([np.ones_like(found.depth), found.depth**4], axis=1)
    variance = np.maximum(found.sigma, quantum) ** 2
    return _fitted(squares / variance[:, None], quantum)


def _fitted(terms: FloatArray, quantum: float) -> DepthNoise:
    """The noise whose squared terms (L, 2) over the measured variances are best summed to 1."""
    from scipy.optimize import nnls

    (constant, quadratic), _ = nnls(terms, np.ones(len(terms)))
    return DepthNoise(
        constant=max(float(np.sqrt(constant)), quantum), quadratic=float(np.sqrt(quadratic))
    )
