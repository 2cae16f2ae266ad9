"""What a set of scans says about its sensor, in numbers and in words."""

from dataclasses import dataclass

from scanweld.evidence.evidence import NO_LIMIT, PatchLimits
from scanweld.geometry.gauss_newton import NEARLY_ALL_SIGMAS

MARGIN = (
    "empty pixels nearer than {:.1%} to the border of what a scan shows say nothing: right poses "
    "put surface there, as of scans that were trimmed or lost their edges"
)
CLOSURE = (
    "around cycles poses of pairs miss each other by {:.1%} each, as where depth is bent over "
    "whole scans"
)
SPREAD_SIGMAS, NUM_SPREAD_BINS = 5.0, 41
"""How far the spread of the distances is told, in standard deviations, and in how many bins."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorModel:
    """How exact a set's surfaces are, and how far its silhouettes can be believed.

    Lengths are in the scans' unit. Where too few pairs are certain, they are priors.

    Attributes:
        num_certain: Pairs that surfaces alone made certain, from which all this was learnt.
        sigma: Robust standard deviation of the distances between surfaces that should coincide,
            each scan having one pose.
        white: The part of it that neighbouring points do not share: the sensor's noise.
        correlated: The part that they share: bent depth, a scale that is a little off.
        closure: How far one pair's pose moves a scan amiss, where cycles of pairs that stay open
            show it; the whole contains what surfaces lie apart by it.
        misclosure: The same, or what is usual of such surfaces where too few cycles close; the
            tolerance contains it.
        tolerance: Depth tolerance by which poses are judged.
        max_contradiction: Largest patches of violating samples, over what agrees, of a right pose.
        diameter: Of the run.
        max_free_patch: Largest patch in free space of a right pose, as a share of a scan's samples;
            1 where that is not known.
        margin: Distance from silhouettes within which empty pixels say nothing; 0 where silhouettes
            are as exact as the surfaces.
        spread: Distances between surfaces that should coincide, counted in equal bins from
            ``SPREAD_SIGMAS`` standard deviations behind each other to as many before.
    """

    num_certain: int
    sigma: float
    white: float
    correlated: float
    tolerance: float
    max_contradiction: float
    diameter: float
    max_free_patch: float = NO_LIMIT
    closure: float = 0.0
    misclosure: float = 0.0
    margin: float = 0.0
    spread: tuple[int, ...] = ()

    @property
    def reach(self) -> float:
        """How far apart surfaces that should coincide may lie, in the scans' unit."""
        return NEARLY_ALL_SIGMAS * self.sigma

    @property
    def limits(self) -> PatchLimits:
        """What the set excuses."""
        return PatchLimits(
            contradiction=self.max_contradiction, free=self.max_free_patch, thickness=self.sigma
        )

    @property
    def _misses(self) -> bool:
        """Whether cycles stay more open than noise leaves them."""
        return self.closure > self.white

    def words(self) -> str:
        """The same in a sentence."""
        if not self.num_certain:
            return "too few pairs are certain to say how exact the sensor is: usual values are used"
        diameter = self.diameter
        pairs = "one certain pair" if self.num_certain == 1 else f"{self.num_certain} certain pairs"
        return (
            f"from {pairs}: surfaces lie {self.sigma / diameter:.2%} of the diameter apart "
            f"({self.white / diameter:.2%} noise, {self.correlated / diameter:.2%} shared by "
            f"neighbours); depth is compared to within {self.tolerance / diameter:.1%}"
            + (f"; {CLOSURE.format(self.closure / diameter)}" if self._misses else "")
            + (f"; {MARGIN.format(self.margin / diameter)}" if self.margin else "")
        )
