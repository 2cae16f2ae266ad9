"""What a set of scans says about its sensor, in numbers and in words."""

from dataclasses import dataclass

MARGIN = (
    "empty pixels nearer than {:.1%} to the border of what a scan shows say nothing: right poses "
    "put surface there, as of scans that were trimmed or lost their edges"
)
SPREAD_SIGMAS, NUM_SPREAD_BINS = 5.0, 41
"""How far the spread of the distances is told, in standard deviations, and in how many bins."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorModel:
    """How exact a set's surfaces are, and how far its silhouettes can be believed.

    Lengths are in the scans' unit. Where too few pairs are certain, they are priors.

    Attributes:
        num_certain: Pairs that surfaces alone made certain, from which all this was learnt.
        sigma: Robust standard deviation of the distances between surfaces that should coincide.
        white: The part of it that neighbouring points do not share: the sensor's noise.
        correlated: The part that they share: bent depth, a scale that is a little off.
        tolerance: Depth tolerance by which poses are judged.
        max_contradiction: Largest patches of violating samples, over what agrees, of a right pose.
        diameter: Of the run.
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
    margin: float = 0.0
    spread: tuple[int, ...] = ()

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
            + (f"; {MARGIN.format(self.margin / diameter)}" if self.margin else "")
        )
