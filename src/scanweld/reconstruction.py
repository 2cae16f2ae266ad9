"""What a run gives back: poses, model, and how far to trust both. Poses relate scan frames."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from scanweld.config import Config
from scanweld.errors import ExitCode
from scanweld.evidence.evidence import Evidence
from scanweld.evidence.slippage import Slide
from scanweld.geometry.mesh import TriangleMesh
from scanweld.geometry.pose import Pose
from scanweld.geometry.prepared import PreparedScan
from scanweld.geometry.scan import Viewpoint
from scanweld.pairs.result import PairKind
from scanweld.sensor.model import SensorModel
from scanweld.work.stage_log import StageReport


class Verdict(StrEnum):
    """The whole run in one word."""

    GOOD = "good"
    PARTIAL = "partial"
    DOUBTFUL = "doubtful"
    NOTHING = "nothing"
    GIVEN = "given"

    @property
    def exit_code(self) -> int:
        """0 for good, and where all poses were given; else 3."""
        is_good = self in (Verdict.GOOD, Verdict.GIVEN)
        return ExitCode.GOOD if is_good else ExitCode.NOT_GOOD


class ScanVerdict(StrEnum):
    """One scan in one word."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    UNPLACED = "unplaced"
    GIVEN = "given"


@dataclass(frozen=True, kw_only=True, slots=True)
class DoubtReport:
    """One thing that speaks against a placed scan's pose.

    Attributes:
        code: Its kind, for programs; see docs/report.md.
        text: In words.
    """

    code: str
    text: str


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanReport:
    """What became of one scan.

    Attributes:
        verdict: Good, doubtful or unplaced; given if its pose was, and is not judged.
        reason: Why, in a sentence.
        doubts: All that makes it doubtful; the first is the reason.
        num_points: Finite points read; 0 if the scan could not be read.
        num_dropped: NaN and infinite points left out.
        resolution: Median point spacing, in the scans' unit; None where not measured.
        diameter: Diagonal of the box along the principal axes; None where not measured.
        camera: Model of the camera in words, such as "pinhole 300 x 300"; None where none is known.
        viewpoint: How it is known where the sensor stood.
        notes: What was assumed.
        content_hash: Hash of the scan's content; None if it could not be read.
        num_keypoints: PA-HKS keypoints; None where nothing asked for them.
        edges: Names of the scans it has an accepted pair with.
        overlap: Largest share of its samples that agree with one other placed scan; None if
            unplaced.
        rms: Point-to-plane residual after the joint refinement, in the scans' unit.
        is_without_support: Whether the plane that the object stands on was left out.
        kept: Cells of its grid that were kept when the object was cut out, as ``cut.mask_of`` reads
            them; None if nothing was cut.
        confidence: Probability that it is placed rightly beside the others of its component; None
            if unplaced.
        grounds: What the confidence rests on, see docs/report.md.
        rotation_bound_deg: Its rotation beside the others of its component is off by no more, at
            95 %, if it is placed rightly; None if unplaced.
        translation_bound: The same of its centroid, in the scans' unit.
        deviation_deg: Standard deviation of its rotation by information, noise and open cycles;
            None if unplaced.
        deviation: The same of its centroid, in the scans' unit.
    """

    verdict: ScanVerdict
    reason: str
    doubts: tuple[DoubtReport, ...] = ()
    num_points: int = 0
    num_dropped: int = 0
    resolution: float | None = None
    diameter: float | None = None
    camera: str | None = None
    viewpoint: Viewpoint = Viewpoint.UNKNOWN
    notes: tuple[str, ...] = ()
    content_hash: str | None = None
    num_keypoints: int | None = None
    edges: tuple[str, ...] = ()
    overlap: float | None = None
    rms: float | None = None
    is_without_support: bool = False
    kept: str | None = None
    confidence: float | None = None
    grounds: Mapping[str, float] = field(default_factory=dict)
    rotation_bound_deg: float | None = None
    translation_bound: float | None = None
    deviation_deg: float | None = None
    deviation: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class AlternativeReport:
    """A distinct pose of a pair (scan frames, in the scans' unit) and its score.

    Attributes:
        i_from_j: The pose.
        score: Its score.
        weight: How much it counts beside the pair's other poses; they sum to 1. None where a mark
            decides against it.
    """

    i_from_j: Pose
    score: float
    weight: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PairReport:
    """What became of one pair; i < j by name, poses relate scan frames.

    Attributes:
        i: Name of the first scan,
        j: of the second.
        kind: What the two scans alone say.
        accepted: Whether the view graph uses the pair.
        reason: Why not, or a remark; may be empty.
        i_from_j: The accepted pose, else the best found; None where nothing fits at all.
        score: Its score; None where nothing fits.
        overlap: Share of the scans' samples that lie on the other's surface; 0 where nothing fits.
        evidence: Its evidence; None where nothing fits.
        margin: Share of the score by which it beats the best distinct rival.
        observability: Smallest over largest eigenvalue of its information.
        sliding: What the surfaces slide like on each other, if the pair is a sliding one.
        searched: Whether all poses were tried. If not, its pose came from a quick search or from
            other pairs, and its margin is over the rivals that were seen on the way.
        alternatives: All distinct poses kept, best first.
        passed_over: Poses that fit as well but for a small mark, which decides against them.
        confidence: Probability that i_from_j is right; 0 where nothing fits.
        grounds: What the confidence rests on, see docs/report.md.
    """

    i: str
    j: str
    kind: PairKind
    accepted: bool
    reason: str
    i_from_j: Pose | None
    score: float | None
    overlap: float
    evidence: Evidence | None
    margin: float
    observability: float
    sliding: Slide | None = None
    searched: bool = True
    alternatives: tuple[AlternativeReport, ...] = ()
    passed_over: tuple[AlternativeReport, ...] = ()
    confidence: float = 0.0
    grounds: Mapping[str, float] = field(default_factory=dict)


class FactVerdict(StrEnum):
    """One fact that users gave, in one word."""

    HELD = "held"
    OPEN = "open"
    CONTRADICTED = "contradicted"


@dataclass(frozen=True, kw_only=True, slots=True)
class FactReport:
    """What became of one fact that users gave.

    Attributes:
        fact: What was given, such as "together a b".
        verdict: Whether the evidence bears it out, leaves it open or speaks against it.
        reason: Why, in a sentence.
    """

    fact: str
    verdict: FactVerdict
    reason: str


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Reconstruction:
    """Everything a run found out.

    Attributes:
        poses: world_from_scan of every placed scan, in the frame of its own component.
        components: Names of the scans of each component, largest first, each with its reference
            scan first, whose pose is the identity unless users fixed it elsewhere.
        unplaced: Reason for every scan that has no pose.
        scans: Report of every scan.
        pairs: Report of every pair, ordered by names.
        mesh: Fused surface of the largest component, in its frame; None if nothing was placed, or
            what was placed could not be fused.
        preview: The same of doubtful scans, where all of that component are: to look at, no model.
        verdict: The whole in one word.
        reasons: Why it is not good, in sentences.
        stages: Time and memory per stage, in the order of the run.
        config: The resolved settings.
        knowledge: What became of the facts that users gave; empty if they gave none.
        prepared: The scans that took part, prepared, by name.
        sensor: What the set says of its sensor; None where poses were given, and nothing was asked.
    """

    poses: Mapping[str, Pose]
    components: tuple[tuple[str, ...], ...]
    unplaced: Mapping[str, str]
    scans: Mapping[str, ScanReport]
    pairs: tuple[PairReport, ...]
    mesh: TriangleMesh | None
    verdict: Verdict
    reasons: tuple[str, ...]
    stages: Mapping[str, StageReport]
    config: Config
    knowledge: tuple[FactReport, ...] = ()
    preview: TriangleMesh | None = None
    prepared: Mapping[str, PreparedScan] = field(default_factory=dict)
    sensor: SensorModel | None = None
