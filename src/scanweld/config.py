"""Settings: one frozen section a stage, every length a multiple of the resolution or the diameter.

Names say the unit: ``*_diameters`` is a multiple of the scans' diameter, ``*_resolutions`` of their
point spacing, ``*_pixels`` of a range image's footprint on the object, ``*_deg`` an angle.
"""

import logging
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from scanweld.choices import Component, Holes, Method, Shown, Unit
from scanweld.errors import ConfigError

logger = logging.getLogger(__name__)

Positive = Annotated[float, Field(gt=0)]
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
    """Radius of the morphological closing of the silhouette, outside of which pixels are free."""
    rim_pixels: int = Field(default=2, ge=1)
    """Width of the rim along depth jumps, holes and the silhouette, where depth is unreliable."""
    min_cosine: float = Field(default=0.15, ge=0, lt=1)
    """Cosine of incidence below which a pixel is too oblique for a sample or a keypoint."""
    support: Literal["left out", "kept"] = "left out"
    """Whether the table that the object stands on is left out, where most scans show one."""
    num_samples: int = Field(default=800, ge=100)
    """Oriented sample points of a scan, at most."""


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
    """The surface on which heat spreads: the front closed by side walls and a back plane, as
    published; or the front alone, its border insulated ("open") or kept cold ("clamped")."""
    jumps: Literal["cut", "bridged"] = "cut"
    """Whether the front is cut at depth jumps, or continued across them."""
    times: Literal["resolved", "sun"] = "resolved"
    """Diffusion times as above, or those of Sun et al.: 4 ln 10 over the last and first
    eigenvalues."""


class PairsConfig(Section):
    """Pair registration without a start pose."""

    keypoints: Literal["mixed", "heat", "even"] = "mixed"
    """Points that are matched to make hypotheses: PA-HKS keypoints ("heat"), evenly spread points
    ("even"), or both."""
    num_anchors: int = Field(default=64, ge=8)
    """Evenly spread points of a scan that are matched. Their number is fixed, so that it is enough
    for thin objects as well as for thick ones."""
    num_turns: int = Field(default=24, ge=8)
    """Rotations about the normal that are tried for each pair of matched points."""
    tolerance_diameters: tuple[Positive, Positive, Positive] = (0.04, 0.02, 0.012)
    """Depth difference up to which two surfaces agree, in the coarse, middle and fine stage."""
    num_survivors: tuple[Count, Count] = (400, 60)
    """Hypotheses that are kept for the first and for the second refinement."""
    num_alternatives: int = Field(default=8, ge=1)
    """Distinct poses of a pair that are passed to the view graph, at most."""
    min_score: float = Field(default=0.05, ge=0, le=1)
    """Score below which a pair is not accepted on its own. Contradictions have a limit of their
    own, so that little overlap is enough."""
    max_contradiction: float = Field(default=0.10, ge=0)
    """Largest patches of samples that the other sensor contradicts, over what agrees, above which a
    pair is not accepted on its own; more where the set shows that its silhouettes are none."""
    min_margin: float = Field(default=0.4, ge=0, le=1)
    """Share of its score by which the best pose must beat the best distinct alternative."""
    min_observability: float = Field(default=2.5e-4, ge=0)
    """Smallest over largest eigenvalue of the information matrix, less what noise contributes to
    it, below which the pose can slide."""

    @property
    def fine_tolerance_diameters(self) -> float:
        """Depth tolerance of the evidence on answers."""
        return self.tolerance_diameters[2]


class CoarseConfig(Section):
    """Coarse registration as published (paper 3.1), for the method "paper" only.

    Where the paper leaves something open, the default is the reading that did best.
    """

    mutual: bool = False
    """Whether matched signatures must be each other's nearest; as printed (eq. 1), it is enough
    that one is the other's nearest."""
    max_signature_distance: float | None = Field(default=None, gt=0)
    """Threshold of eq. 1 on the root mean square difference of the log signatures; if None, it is
    set by the quantile below."""
    signature_quantile: float = Field(default=1.0, gt=0, le=1)
    """The threshold of eq. 1 as a quantile of the matches' distances: 0.5 is the median, 1 keeps
    all. Every lower threshold did worse, because it removes right and wrong matches alike."""
    icp: Literal["keypoints", "surface"] = "surface"
    """Points that the ICP aligns: the matched keypoints alone, or the scans' surfaces."""
    trim: Share | Literal["auto"] | None = None
    """Share of the matches, the closest ones, that the ICP uses; found in each step if "auto", all
    if None."""
    start: Literal["fit", "consensus", "evidence"] = "fit"
    """Start of the ICP: a fit to all matches, as published ("fit"). Not in the paper: the pose on
    which most of the nearest signatures agree ("consensus"), or the poses from pairs of keypoints
    that agree best with the range images, whatever the signatures ("evidence")."""
    num_nearest: int = Field(default=8, ge=1)
    """Nearest signatures that are tried for each keypoint in a consensus."""


class GraphConfig(Section):
    """Pairs -> poses of all scans that can be placed."""

    max_cycle_deg: float = Field(default=5.0, gt=0)
    """Rotation error above which a closed cycle of pairs contradicts itself."""
    max_cycle_diameters: float = Field(default=0.03, gt=0)
    """The same for the displacement of a scan's centre."""
    min_edge_score: float = Field(default=-0.05, ge=-1, le=1)
    """Score below which a pair is not accepted even where it agrees with the final poses."""
    min_mutual_score: float = Field(default=0.15, ge=0)
    """Least score of a merge that several weak pairs propose together."""
    max_mutual_violated_share: float = Field(default=0.1, ge=0)
    """Number of samples that the other sensors contradict in such a merge over the number that
    agree, at most."""
    min_margin: float = Field(default=0.2, ge=0, le=1)
    """Share of its score by which a merge must beat the best distinct one."""


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
    """Predicted contours that eq. 4 removes: those seen on triangles at the border of their own
    scan, or those at the same place in space as its contours."""
    predicted_visibility: Literal["face", "depth", "observed normal", "printed"] = "face"
    """Condition of eq. 6 on a predicted contour point: the rendered face looks towards camera j;
    the point is not behind what j observed; the surface that j observed in its pixel looks towards
    camera j; or (as printed) towards camera i."""
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
    """Distance of matched contours that is minimised: in space, as in trimmed ICP, which converges
    from farther away; in the image, as in M-ICC, which ends closer to the truth; the one after the
    other; or (not in the paper) both, and then the distance across the outline alone."""


class RefineConfig(Section):
    """Joint refinement of all poses with surface and contour terms."""

    num_rounds: int = Field(default=8, ge=1)
    """Rounds of matching and solving."""
    match_diameters: tuple[Positive, Positive] = (0.02, 0.006)
    """Farthest match, in the first and in the last round."""
    contour_weight: float = Field(default=0.3, ge=0)
    """Weight of a contour match relative to a surface match of the same precision; 0 leaves
    contours out."""


class ConfidenceConfig(Section):
    """Evidence -> probability that a pose is right."""

    min_good: float = Field(default=0.9, ge=0, le=1)
    """Confidence below which a placed scan is marked doubtful."""
    min_accuracy_percent: float | None = Field(default=None, gt=0)
    """A placed scan is marked doubtful if its surface may be off by more, in percent of the
    diameter, at 95 %; not asked if not given."""


class FusionConfig(Section):
    """Posed scans -> one mesh."""

    voxel_resolutions: float = Field(default=1.0, gt=0)
    """Edge of a voxel, unless the limit on the number of voxels below asks for a larger one."""
    max_voxels_across: int = Field(default=1000, ge=50)
    """Voxels across the object's diameter, at most."""
    truncation_voxels: float = Field(default=4.0, ge=2)
    """Truncation of the signed distance."""
    with_doubtful: bool = False
    """Whether doubtful scans, which are placed but may be wrong, are fused too."""
    holes: Holes = "open"
    """What is done where no scan saw the surface: it is left open, closed by a membrane ("fill"),
    or closed along the border of the space that was seen empty ("carve"). Vertices that were not
    measured are marked in the model."""
    component: Component = "all"
    """Whether all connected pieces are kept, except very small ones, or only the largest."""
    watertight: bool = False
    """Whether the mesh must be closed: holes are filled, unless they are carved."""
    smooth: int = Field(default=0, ge=0, le=1000)
    """Rounds of smoothing that does not shrink the model (Taubin 1995); borders stay."""
    faces: int | None = Field(default=None, ge=4)
    """Approximate number of triangles of the model; no limit if not given."""


class Config(Section):
    """All settings of a run; ``Config()`` holds the defaults.

    There is no seed: the scans and the settings determine every byte of the output.
    """

    method: Method = "robust"
    """How poses are found: by an exhaustive search and joint refinement ("robust"), or as
    published, by PA-HKS matches with ICP and MM-ICC ("paper"). The same rules judge both."""
    object: Shown = "auto"
    """What of whole depth frames is the object: what moves before a standing camera, where the
    frames show that ("auto"), or else nothing is done ("moving"); or all that is seen ("all")."""
    unit: Unit | None = None
    """Unit of the scans' coordinates; unknown if not given. It is written to the report with the
    settings; nothing else depends on it."""
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
        if values.pop("seed", None) is not None:  # of 0.1.0, whose model folders stay readable
            logger.warning("%s: seed: is ignored, as a run has nothing random", path)
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
