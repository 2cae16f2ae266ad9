"""Settings: defaults, files, ranges, and one clear line where something is wrong."""

import re
import tomllib
from pathlib import Path

import pytest
from pydantic import ValidationError

from scanweld.config import Config, PairsConfig, Section, load_config
from scanweld.errors import ConfigError

CHANGED = Config(
    unit="mm",
    pairs=PairsConfig(
        keypoints="even", num_turns=36, tolerance_diameters=(0.05, 0.03, 0.01), min_margin=0.25
    ),
)


def refusal(tmp_path: Path, text: str) -> str:
    """The message with which a settings file is refused; one line that names the file."""
    path = tmp_path / "my settings.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        load_config(path)
    told = str(raised.value)
    assert told.startswith(f"{path}: ") and len(told.splitlines()) == 1
    return told


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("sed = 1", "sed: no such setting; "),
        ("[pairs]\nmin_scores = 0.1", "pairs.min_scores: no such setting; "),
        ("[pears]\nmin_score = 0.1", "pears: no such setting; "),
        ("[fusion.more]\nx = 1", "fusion.more: no such setting; "),
        ("[pairs]\nmin_score = 1.5", "pairs.min_score: "),
        ("[pairs]\nnum_turns = 2", "pairs.num_turns: "),
        ("[pairs]\nkeypoints = 'sift'", "pairs.keypoints: "),
        ("[pairs]\ntolerance_diameters = [0.04, 0.02]", "pairs.tolerance_diameters.2: "),
        ("[pairs]\ntolerance_diameters = [0.04, 0.02, 0.0]", "pairs.tolerance_diameters.2: "),
        ("[pairs]\nnum_survivors = [300, 0]", "pairs.num_survivors.1: "),
        ("[refine]\nmatch_diameters = [0.02, -1.0]", "refine.match_diameters.1: "),
        ("[refine]\ncontour_weight = inf", "refine.contour_weight: "),
        ("[graph]\nmax_cycle_deg = nan", "graph.max_cycle_deg: "),
        ("[prepare]\nnum_samples = 'many'", "prepare.num_samples: "),
        ("[prepare]\nimage_pixels = 100.5", "prepare.image_pixels: "),
        ("[contours]\ntrim = 0.0", "contours.trim: "),
        ("unit = 'furlong'", "unit: "),
        ("method = 'nonsense'", "method: .*robust.*paper"),
        ("[coarse]\nicp = 'splines'", "coarse.icp: "),
        ("[heat]\nsurface = 'ajar'", "heat.surface: "),
        ("pairs = 3", "pairs: "),
    ],
)
def test_a_setting_unknown_or_out_of_its_range_is_named(tmp_path: Path, text: str, place: str):
    assert re.search(f": {place}", refusal(tmp_path, text))


@pytest.mark.parametrize("text", ["unit = ", "[pairs", "unit = 1\nunit = 2", "= 3", "a b c\n" * 3])
def test_text_that_is_no_toml_is_refused(tmp_path: Path, text: str):
    assert "TOML" in refusal(tmp_path, text)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(bytes(range(256)))
    for path in (binary, tmp_path / "none.toml", tmp_path):
        with pytest.raises(ConfigError, match=re.escape(str(path))):
            load_config(path)


@pytest.mark.parametrize("config", [Config(), CHANGED])
def test_written_settings_are_complete_and_come_back(tmp_path: Path, config: Config):
    path = tmp_path / "config.toml"
    path.write_text(config.to_toml(), encoding="utf-8")
    assert load_config(path) == config
    told = tomllib.loads(config.to_toml())
    for name, section in config:
        if isinstance(section, Section):
            assert set(told[name]) == {key for key, value in section if value is not None}
    assert ("unit" in told) is (config is CHANGED)


def test_defaults_then_file_then_overrides_and_no_other_change(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    """A seed, which the settings of 0.1.0 had, is ignored, and said to be."""
    path = tmp_path / "config.toml"
    text = "seed = 3\nmethod = 'paper'\nunit = 'cm'\n[graph]\nmin_margin = 0.5\n"
    path.write_text(text, encoding="utf-8")
    config = load_config(path, method="robust", unit=None)
    assert (config.method, config.unit) == ("robust", "cm")
    assert [record.message for record in caplog.records] == [
        f"{path}: seed: is ignored, as a run has nothing random"
    ]
    assert config.graph.min_margin == 0.5
    assert config.graph.min_edge_score == Config().graph.min_edge_score
    assert load_config(None) == Config()
    with pytest.raises(ConfigError, match="settings: unit"):
        load_config(None, unit="furlong")
    with pytest.raises(ValidationError):
        Config().unit = "mm"  # type: ignore[misc]
    with pytest.raises(ValidationError):
        Config().pairs.min_score = 0.3  # type: ignore[misc]
