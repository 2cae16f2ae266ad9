"""Settings: one frozen section a stage, every length a multiple of the resolution or the diameter.

Names say the unit: ``*_diameters`` is a multiple of the scans' diameter, ``*_resolutions`` of their
point spacing, ``*_pixels`` of a range image's footprint on the object, ``*_deg`` an angle.
"""

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from scanweld.errors import ConfigError

Unit = Literal["m", "cm", "mm", "in"]
Method = Literal["robust", "paper"]
Positive = Annotated[float, Field(gt=0)]
Holes = Literal["open", "fill", "carve"]
Component = Literal["largest", "all"]
Count = Annotated[int, Field(ge=1)]
Share = Annotated[float, Field(gt=0, le=1)]
Pruning = Literal["self-occlusion", "observed", "predicted"]


class Section(BaseModel):
    """A frozen group of settings; unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class PrepareConfig(Section):
    """Scan -> range image, mesh and samples."""

    image_pixels: int = Field(default=300, ge=64, le=2000)
    """Pixels of the working range image across the diameter, at most; never finer than the scan."""
    jump_pixels: float = Field(default=6.0, gt=1)
    """Depth step between neighbouring pixels, in footprints, above which the surface is cut."""
    closing_diameters: float = Field(default=0.03, ge=0, le=0.2)
    """Radius by which the silhouette is closed before what lies outside it counts as free."""
    rim_pixels: int = Field(default=2, ge=1)
    """Width of the rim along jumps, holes and the silhouette."""
    min_cosine: float = Field(default=0.15, ge=0, lt=1)
    """Cosine between normal and viewing ray below which a place is too oblique for a sample."""
    support: Literal["left out", "kept"] = "left out"
    """What becomes of the table that the object stands on, where most scans show one."""
    num_samples: int = Field(default=800, ge=100)
    """Oriented samples of a scan, at most."""


class HeatConfig(Section):
    """PA-HKS keypoints (paper 3.1)."""

    max_front_vertices: int = Field(default=1500, ge=200)
    """The front surface is thinned to this many vertices before the eigenproblem."""
    num_modes: int = Field(default=120, ge=20)
    """Eigenpairs of the Laplace-Beltrami operator."""
    num_times: int = Field(default=10, ge=3)
    """Diffusion times, log-spaced from 4 / lambda_k to the longest."""
    longest_time_diameters2: float = Field(default=2e-2, gt=0)
    """Longest diffusion time, in squared diameters."""
    group_diameters: float = Field(default=0.05, gt=0)
    """Keypoints nearer than this, with like signatures, become one."""
    surface: Literal["closed", "open", "clamped"] = "closed"
    """What heat spreads on: the front closed by walls and a back plane, as published; the front
    alone, whose rims let no heat out, or keep cold."""
    jumps: Literal["cut", "bridged"] = "cut"
    """Whether the front is cut at depth jumps, or goes on across them."""
    times: Literal["resolved", "sun"] = "resolved"
    """Diffusion times as above, or those of Sun et al.: 4 ln 10 over the last and first
    eigenvalues."""


class PairsConfig(Section):
    """Pair registration from any start pose."""

    keypoints: Literal["mixed", "heat", "even"] = "mixed"
    """What anchors the hypotheses: PA-HKS keypoints ("heat"), evenly spread points, or both."""
    num_anchors: int = Field(default=64, ge=8)
    """Evenly spread anchors of a scan: a fixed number covers thin objects as well as stout ones."""
    num_turns: int = Field(default=24, ge=8)
    """Turns about the normal that are tried for each pair of anchors."""
    tolerance_diameters: tuple[Positive, Positive, Positive] = (0.04, 0.02, 0.012)
    """Depth tolerance of the evidence, coarse to fine."""
    num_survivors: tuple[Count, Count] = (1600, 100)
    """Hypotheses that go on to the first and to the second refinement."""
    num_alternatives: int = Field(default=8, ge=1)
    """Distinct poses of a pair that go on to the view graph."""
    min_score: float = Field(default=0.10, ge=0, le=1)
    """Score below which a pair is not accepted on its own."""
    max_violated_share: float = Field(default=0.5, ge=0)
    """Samples that the other sensor contradicts in any way, as a share of those that agree, above
    which a pair is not accepted on its own: wrong poses often agree widely, but not cleanly."""
    min_margin: float = Field(default=0.4, ge=0, le=1)
    """Share of the score by which the best pose must beat its best distinct rival."""
    min_observability: float = Field(default=2.5e-4, ge=0)
    """Smallest over largest eigenvalue of the information that noise cannot feign, below which a
    pose slides."""

    @property
    def fine_tolerance_diameters(self) -> float:
        """Depth tolerance of the evidence on answers."""
        return self.tolerance_diameters[2]


class CoarseConfig(Section):
    """Coarse registration as published (paper 3.1), for the method "paper" only.

    The paper leaves open what is read here; the defaults are the reading that did best.
    """

    mutual: bool = False
    """Whether matched signatures must be each other's nearest; as printed, only s asks (eq. 1)."""
    max_signature_distance: float | None = Field(default=None, gt=0)
    """Threshold of eq. 1: root mean square difference of the log signatures. By the quantile if
    None."""
    signature_quantile: float = Field(default=1.0, gt=0, le=1)
    """The threshold of eq. 1 as a quantile of the matches' distances: 0.5 is the median, 1 keeps
    all. Every threshold did worse: it takes away right matches like wrong ones."""
    icp: Literal["keypoints", "surface"] = "surface"
    """What the ICP aligns: the matched keypoints alone, or the scans' surfaces."""
    trim: Share | Literal["auto"] | None = None
    """Share of the closest points that the ICP goes by, or "auto"; all if None."""
    start: Literal["fit", "consensus", "evidence"] = "fit"
    """Where the ICP starts: at a fit to all matches, as published; or, ours, where most of the
    nearest signatures agree, or at the poses of keypoints that the sensors' evidence speaks for,
    whatever the signatures."""
    num_nearest: int = Field(default=8, ge=1)
    """Nearest signatures that are tried for each keypoint where the matches must agree."""


class GraphConfig(Section):
    """Pairs -> poses of all scans that can be placed."""

    max_cycle_deg: float = Field(default=5.0, gt=0)
    """Closing error above which a cycle of pairs contradicts itself."""
    max_cycle_diameters: float = Field(default=0.03, gt=0)
    """The same for the shift of the middle of a scan."""
    min_edge_score: float = Field(default=-0.05, ge=-1, le=1)
    """Score below which a pair is not called accepted even where it agrees with the poses."""
    min_mutual_score: float = Field(default=0.15, ge=0)
    """Least score of a merge that rests on several weak pairs that propose the same motion."""
    max_mutual_violated_share: float = Field(default=0.1, ge=0)
    """Most samples that the other sensors contradict in such a merge, as a share of those that
    agree."""
    min_margin: float = Field(default=0.2, ge=0, le=1)
    """Share of its score by which a merge must beat the best distinct one."""
    max_violated_share: float = Field(default=0.15, ge=0)
    """Samples that the other sensors contradict, as a share of those that agree, above which a
    merge is refused and a placed scan is doubtful."""
    max_inner_violated_share: float = Field(default=0.075, ge=0)
    """The same of a merge at second sight: all scans have settled in it, and edges say nothing."""
    max_violation: float = Field(default=0.03, ge=0)
    """Share of samples by which violation may exceed half the agreement in any pair across a
    merge."""


class ContoursConfig(Section):
    """M-ICC and MM-ICC (paper 3.2).

    A run takes its contour sets and prunings into the joint refinement; ``matching`` and what
    follows are for views aligned by contours alone (``contours.mm_icc``, ``contours.m_icc``).
    """

    jump_pixels: float = Field(default=5.0, gt=1)
    """Depth steps tau_1 = tau_2 of the contour sets (eqs 2, 3), in footprints."""
    prunings: tuple[Pruning, ...] = ("self-occlusion", "observed", "predicted")
    """Which prunings are made: the first (eq. 4), the second (eq. 5), the third (eq. 6)."""
    self_occlusion: Literal["border", "place"] = "border"
    """What eq. 4 takes away: predicted contours seen on triangles at the rim of their own scan, or
    those at the same place in space as its contours."""
    predicted_visibility: Literal["face", "depth", "observed normal", "printed"] = "face"
    """What eq. 6 asks of a predicted contour point: that the rendered face looks towards camera j,
    that it is not behind what j observed, that the surface observed by j in its pixel looks towards
    camera j, or (as printed) towards camera i."""
    matching: Literal["trimmed", "mutual"] = "trimmed"
    """Closest observed points, the farthest left out (MM-ICC), or only pairs of points that are
    closest to each other (M-ICC)."""
    trim: float | None = Field(default=0.9, gt=0, le=1)
    """Share of the contour matches that trimmed ICP keeps; found anew in each step if None."""
    num_renders: int = Field(default=40, ge=1)
    """Outer iterations, at most: predicted range images are rendered anew in each."""
    num_steps: int = Field(default=3, ge=1)
    """Inner iterations between two renderings."""
    residual: Literal["point", "image", "point, image", "normal"] = "point, image"
    """What is minimised of the contours matched: their distance in space, as in trimmed ICP, which
    gets in from afar; their distance in the image, which is M-ICC's and lies closer; the one after
    the other; or, ours, both and then the distance across the outline alone."""


class RefineConfig(Section):
    """Joint refinement of all poses with surface and contour terms."""

    num_rounds: int = Field(default=8, ge=1)
    """Rounds of matching and solving."""
    match_diameters: tuple[Positive, Positive] = (0.02, 0.006)
    """Farthest match, in the first and in the last round."""
    contour_weight: float = Field(default=0.3, ge=0)
    """Weight of a contour match beside a surface match of the same precision; 0 leaves contours
    out."""


class ConfidenceConfig(Section):
    """Evidence -> probability that a pose is right."""

    min_good: float = Field(default=0.9, ge=0, le=1)
    """Confidence below which a placed scan is doubtful. Of 44 wrong scans of the calibration 4 had
    more, held out."""


class FusionConfig(Section):
    """Posed scans -> one mesh."""

    voxel_resolutions: float = Field(default=1.0, gt=0)
    """Edge of a voxel, where that is not too fine for the number of voxels below."""
    max_voxels_across: int = Field(default=1000, ge=50)
    """Voxels across the object's diameter, at most."""
    truncation_voxels: float = Field(default=4.0, ge=2)
    """Distance at which the signed distance is cut off."""
    with_doubtful: bool = False
    """Whether doubtful scans are part of the model too: they are placed, but may be wrong."""
    holes: Holes = "open"
    """What becomes of what no scan saw: left open, spanned by a membrane ("fill"), or bounded by
    the space that was seen empty ("carve"). What was not measured is marked in the model."""
    component: Component = "all"
    """Whether every connected piece is kept that is no crumb, or only the largest."""
    watertight: bool = False
    """Whether the mesh must be closed: holes are filled, unless they are carved."""
    smooth: int = Field(default=0, ge=0, le=1000)
    """Rounds of smoothing that does not shrink (Taubin 1995); borders stay."""
    faces: int | None = Field(default=None, ge=4)
    """Triangles of the model, about; all that the voxels give if not given."""


class Config(Section):
    """All settings of a run; ``Config()`` is what users get who give none."""

    seed: int = Field(default=0, ge=0)
    """Seed of everything random in a run. No stage draws random numbers as it stands, so that the
    scans' content and the other settings alone fix the output's bytes."""
    method: Method = "robust"
    """How poses are found: by the search from any start and the joint refinement ("robust"), or as
    published, by PA-HKS matches with ICP and MM-ICC ("paper"); both are judged alike."""
    unit: Unit | None = None
    """Unit of the scans' coordinates; unknown if not given. It is passed on with the settings in
    the report, and nothing else depends on it."""
    prepare: PrepareConfig = PrepareConfig()
    heat: HeatConfig = HeatConfig()
    pairs: PairsConfig = PairsConfig()
    coarse: CoarseConfig = CoarseConfig()
    graph: GraphConfig = GraphConfig()
    contours: ContoursConfig = ContoursConfig()
    refine: RefineConfig = RefineConfig()
    confidence: ConfidenceConfig = ConfidenceConfig()
    fusion: FusionConfig = FusionConfig()

    def to_toml(self) -> str:
        """The settings as TOML text; what is unknown (None) is left out."""
        return tomli_w.dumps(self.model_dump(mode="json", exclude_none=True))


def load_config(path: Path | None, **overrides: Any) -> Config:
    """Settings from defaults, then a TOML file, then overrides that are not None.

    Overrides are top-level settings, or a whole section's as a mapping.

    Raises:
        ConfigError: If the file cannot be read, or a setting is unknown or out of its range.
    """
    values: dict[str, Any] = {}
    if path is not None:
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise ConfigError(f"{path}: cannot be read as TOML settings ({error})") from error
    for key, value in overrides.items():
        if isinstance(value, dict) and isinstance(values.get(key, {}), dict):
            given = {name: setting for name, setting in value.items() if setting is not None}
            values[key] = {**values.get(key, {}), **given}
        elif value is not None:
            values[key] = value
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        wrong = "no such setting" if first["type"] == "extra_forbidden" else first["msg"]
        raise ConfigError(
            f"{path or 'settings'}: {where}: {wrong}; correct it (the config.toml of any run names "
            "all settings)"
        ) from error
