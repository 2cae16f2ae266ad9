"""The judge of a run: what the sensors say of any pair of its scans at any pose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from scanweld.evidence.evidence import Evidence, PatchLimits
from scanweld.evidence.field import ScanField
from scanweld.evidence.patches import PixelConsensus, pixel_consensus
from scanweld.evidence.pixels import see
from scanweld.evidence.sample_patches import violating_patches
from scanweld.evidence.visibility import AGREE, evidence_of, evidence_shares, pose_rows
from scanweld.geometry.arrays import FloatArray
from scanweld.geometry.pose import Pose

NUM_JUDGED_SAMPLES = 300
"""Samples of a scan that judge merges and refinements: thousands of poses are asked about."""

Poses = Mapping[int, Pose]
"""component_from_sensor of a component's scans, by index."""


class PairJudge(Protocol):
    """What the stages after the pairs ask: how well scans fit at a pose, by index."""

    @property
    def limits(self) -> PatchLimits:
        """How large patches of violating samples the set excuses."""
        ...

    def pair(self, i: int, j: int, i_from_j: Pose) -> Evidence:
        """Mean evidence of both directions at a pose between the sensor frames."""
        ...

    def poses(self, i: int, j: int, i_from_j: Sequence[Pose]) -> list[Evidence]:
        """The same at several poses."""
        ...

    def pixels(self, a: Poses, b: Poses) -> list[PixelConsensus]:
        """What two components' sensors say of all pixels of each other's scans, a's scans first.

        The poses of both are in one frame.
        """
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Judge:
    """The scans of a run, laid out, and the tolerances by which they are compared.

    Attributes:
        fields: The scans, laid out.
        diameter: Diameter of the run, in the scans' unit.
        tolerance: Depth tolerance of the evidence, in the scans' unit.
        limits: How large patches of violating samples the set excuses.
    """

    fields: Sequence[ScanField]
    diameter: float
    tolerance: float
    limits: PatchLimits

    @cached_property
    def centres(self) -> list[FloatArray]:
        """(3,) middle of each scan's samples, sensor frame."""
        return [field.centre for field in self.fields]

    def pair(self, i: int, j: int, i_from_j: Pose) -> Evidence:
        """Mean evidence of both directions at a pose between the sensor frames."""
        (evidence,) = self.poses(i, j, [i_from_j])
        return evidence

    def poses(self, i: int, j: int, i_from_j: Sequence[Pose]) -> list[Evidence]:
        """The same at several poses, in one call of the kernel."""
        a, b = self.fields[i], self.fields[j]
        both = evidence_shares(a, b, pose_rows(i_from_j), self.tolerance, NUM_JUDGED_SAMPLES)
        patches = violating_patches(a, b, i_from_j, self.tolerance, self.limits.thickness)
        mean = 0.5 * (both[:, 0] + both[:, 1])
        return [evidence_of(*told) for told in zip(mean.tolist(), patches.tolist(), strict=True)]

    def agree(self, i: int, j: int, i_from_j: Pose) -> float:
        """Share of samples that agree at a pose, as ``pair`` says: for half of its price."""
        both = evidence_shares(
            *(self.fields[i], self.fields[j], pose_rows([i_from_j])),
            *(self.tolerance, NUM_JUDGED_SAMPLES),
        )
        return float(0.5 * (both[0, 0, AGREE] + both[0, 1, AGREE]))

    def pixels(self, a: Poses, b: Poses) -> list[PixelConsensus]:
        """What two components' sensors say of all pixels of each other's scans, a's scans first.

        The poses of both are in one frame.
        """
        seen = {
            (i, j): see(self.fields[i], self.fields[j], a[i].inverse() @ b[j], self.diameter)
            for i in a
            for j in b
        }
        of_a = [pixel_consensus([seen[i, j][0] for j in b], self.tolerance) for i in a]
        return of_a + [pixel_consensus([seen[i, j][1] for i in a], self.tolerance) for j in b]
