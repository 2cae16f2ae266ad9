"""The record of visibility evidence on a relative pose, and its score."""

from collections.abc import Iterable
from dataclasses import dataclass

VIOLATION_WEIGHT = 3.0
"""How much more a sample says that the other sensor contradicts than one that agrees."""
CONTRADICT_WEIGHT = 1.5
"""Samples with other normals say less: at edges normals are poor."""
FREE_WEIGHT, GRAZING_WEIGHT = 1.0, 0.2
"""Samples in free space say less; next to nothing where their surface is turned away from the
sensor that looked past them, which may have lost it."""
FRONT_PATCH_WEIGHT, FREE_PATCH_WEIGHT = 2.0, 0.5
"""A patch before a surface counts four times one in free space: surfaces are seen, silhouettes are
inferred. Right poses of cropped and trimmed scans show patches in free space of 0.1 to 0.3 of what
agrees, but next to none before a surface; wrong ones show both."""
MAX_EXCESS = 0.03
"""Share of the samples by which patches of a pair, whose place other pairs say, may exceed what its
set excuses."""
NO_LIMIT = 1.0
"""Of patches in free space, where a set does not tell how far its silhouettes can be believed."""
MIN_AGREE = 0.05
"""Share of agreeing samples below which two scans do not overlap."""


def seen_twice(excesses: Iterable[float]) -> float:
    """By how much at least two pairs exceed what a set excuses.

    A sensor that lost a part of the surface, in a shadow or on a dark spot, looked past it in one
    scan alone; what moved is missing where any scan looks for it.
    """
    largest = sorted(excesses)[-2:]
    return largest[0] if len(largest) == 2 else -NO_LIMIT


@dataclass(frozen=True, kw_only=True, slots=True)
class PatchLimits:
    """How large the violating patches of right poses are in a set.

    Attributes:
        contradiction: Both patches over what agrees, weighted as in ``Evidence.contradiction``.
        free: The patch in free space, as a share of all samples.
        thickness: How far the two sides of an object lie apart, at least, in the scans' unit.
    """

    contradiction: float
    free: float = NO_LIMIT
    thickness: float = 0.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Evidence:
    """What each scan's sensor says of the other's samples, as shares of all samples.

    Shares of one direction or the mean of both directions; they sum to one but for samples whose
    normals neither agree nor contradict.

    Attributes:
        agree: On the surface that the other sensor saw, normals alike.
        front: Before the surface that the other sensor saw: it would have seen them.
        contradict: On that surface, normals clearly different.
        free: Where the other sensor looked past the object, and would have seen them.
        grazing: There too, but turned so far away that it might have missed them.
        occluded: Behind the surface that the other sensor saw.
        unknown: On pixels that say nothing.
        front_patch: Largest patch of samples that hang together before a surface
            (``violating_patches``); 0 where that was not asked.
        free_patch: The same in free space.
        inside_patch: The same on a surface that faces the other way, as if that had no thickness.
    """

    agree: float
    front: float
    contradict: float
    free: float
    occluded: float
    unknown: float
    grazing: float = 0.0
    front_patch: float = 0.0
    free_patch: float = 0.0
    inside_patch: float = 0.0

    @property
    def score(self) -> float:
        """Agreement less weighted violations (docs/report.md): at most 1, which is perfect."""
        violated = VIOLATION_WEIGHT * self.front + CONTRADICT_WEIGHT * self.contradict
        return self.agree - violated - FREE_WEIGHT * self.free - GRAZING_WEIGHT * self.grazing

    @property
    def violation(self) -> float:
        """Share of samples that the other sensor contradicts in any way."""
        return self.front + self.contradict + self.free

    @property
    def patches(self) -> float:
        """Both patches, that before a surface weighing more."""
        return FRONT_PATCH_WEIGHT * self.front_patch + FREE_PATCH_WEIGHT * self.free_patch

    @property
    def contradiction(self) -> float:
        """Patches that violate, as a share of what agrees."""
        return self.patches / max(self.agree, MIN_AGREE)

    def front_excess(self, limits: PatchLimits) -> float:
        """Share of the samples by which patches before surfaces exceed what a set excuses."""
        return FRONT_PATCH_WEIGHT * self.front_patch - limits.contradiction * self.agree

    def free_excess(self, limits: PatchLimits) -> float:
        """The same of patches in free space.

        Scans that hardly meet have little that agrees, and yet such patches where silhouettes are
        cut: these are held to what is seen there at poses that surfaces make sure.
        """
        return self.free_patch - limits.free

    @property
    def surface_violation(self) -> float:
        """The same without free space, weighted as in the score: what *front* is worth."""
        return self.front + CONTRADICT_WEIGHT / VIOLATION_WEIGHT * self.contradict
