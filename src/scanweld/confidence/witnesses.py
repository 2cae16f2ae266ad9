"""What can be asked about a pose of two scans, besides their evidence."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scanweld.confidence.misfit import pair_misfit
from scanweld.config import Config
from scanweld.contours.coherence import contour_coherence
from scanweld.evidence.field import ScanField
from scanweld.evidence.information import information_of, observability_of
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.graph.merge import Judge
from scanweld.refinement.surface_terms import SurfaceSource, surface_source

NUM_POINTS = 2000
"""Surface points of a scan by which misfit is measured."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Looks:
    """How two scans, or a scan and all others, lie on each other.

    Attributes:
        observability: Smallest over largest eigenvalue of the information.
        residual: Rms of the point-to-plane residuals over the tolerance; 1 where there are none.
        misfit: What is left of that when noise is averaged out, over the tolerance.
        coherence: Share of the contours that cohere.
    """

    observability: float
    residual: float
    misfit: float
    coherence: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Witnesses:
    """All scans of a run, and how they are asked.

    Attributes:
        fields: The scans laid out.
        sources: Their surface points.
        judge: Gives the evidence on any pair at any pose.
        cohere: Gives the contour coherence of scans i and j at i_from_j.
        tolerance: Depth tolerance of the evidence, in the scans' unit.
        diameter: Diameter of the run.
    """

    fields: Sequence[ScanField]
    sources: Sequence[SurfaceSource]
    judge: Judge
    cohere: Callable[[int, int, Pose], float]
    tolerance: float
    diameter: float

    def look(self, i: int, j: int, i_from_j: Pose, *, at_contours: bool) -> Looks:
        """How two scans lie on each other at a pose; without its contours, none cohere."""
        size = self.tolerance, self.diameter
        information, rms, _ = information_of(self.fields[i], self.fields[j], i_from_j, *size)
        return Looks(
            observability=observability_of(information),
            residual=over(rms, self.tolerance),
            misfit=pair_misfit(self.sources[i], self.sources[j], i_from_j, *size),
            coherence=self.cohere(i, j, i_from_j) if at_contours else 0.0,
        )


def witnesses_of(
    prepared: Sequence[PreparedScan],
    fields: Sequence[ScanField],
    diameter: float,
    judge: Judge,
    config: Config,
) -> Witnesses:
    """Make the scans of a run ready to be asked."""
    return Witnesses(
        fields=fields,
        sources=[surface_source(scan, NUM_POINTS) for scan in prepared],
        judge=judge,
        cohere=contour_coherence(prepared, config.contours),
        tolerance=config.pairs.tolerance_diameters[2] * diameter,
        diameter=diameter,
    )


def over(rms: float, tolerance: float) -> float:
    """A residual over the tolerance; 1 where there is none."""
    return rms / tolerance if rms == rms else 1.0
