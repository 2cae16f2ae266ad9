"""What is measured of a pose of two scans besides the evidence: how well and firmly they fit."""

from collections.abc import Sequence
from dataclasses import dataclass

from scanweld.confidence.misfit import pair_misfit
from scanweld.config import ContoursConfig
from scanweld.contours.coherence import ContourMatcher, contour_matcher
from scanweld.evidence.information import information_of, observability_of
from scanweld.evidence.judge import Judge
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.sampling import NUM_FEW
from scanweld.refinement.surface_terms import SurfaceSource, surface_source
from scanweld.sensor.model import SensorModel


@dataclass(frozen=True, kw_only=True, slots=True)
class Fit:
    """How two scans, or a scan and all others, lie on each other.

    Attributes:
        observability: Smallest over largest eigenvalue of the information.
        misfit: What is left of the distances between the surfaces when noise is averaged out, over
            what they are where surfaces coincide (``SensorModel.sigma``); infinite without any.
        coherence: Share of the contours that cohere.
    """

    observability: float
    misfit: float
    coherence: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairDiagnostics:
    """All scans of a run, and what is measured of a pose of two of them besides the evidence.

    Attributes:
        judge: Gives the evidence on any pair at any pose.
        sources: Surface points of the scans.
        contours: Compares the contours of any two scans.
        sensor: What the set says of its sensor.
    """

    judge: Judge
    sources: Sequence[SurfaceSource]
    contours: ContourMatcher
    sensor: SensorModel

    def fit(self, i: int, j: int, i_from_j: Pose, *, at_contours: bool) -> Fit:
        """How two scans fit at a pose; where contours are not asked about, none cohere."""
        fields, size = self.judge.fields, (self.judge.tolerance, self.judge.diameter)
        off = pair_misfit(self.sources[i], self.sources[j], i_from_j, *size)
        information, _, _ = information_of(fields[i], fields[j], i_from_j, *size)
        return Fit(
            observability=observability_of(information),
            misfit=over(off, self.sensor.sigma),
            coherence=self.contours.coherence(i, j, i_from_j) if at_contours else 0.0,
        )


def diagnostics_of(
    prepared: Sequence[PreparedScan], judge: Judge, sensor: SensorModel, config: ContoursConfig
) -> PairDiagnostics:
    """Make the scans of a run ready to be measured."""
    return PairDiagnostics(
        judge=judge,
        sources=[surface_source(scan, NUM_FEW) for scan in prepared],
        contours=contour_matcher(prepared, config),
        sensor=sensor,
    )


def over(distance: float, sigma: float) -> float:
    """A distance over the sensor's standard deviation; 1 of a sensor without error."""
    return distance / sigma if sigma > 0 else 1.0
