"""A scene whose poses are known, and a model of it in the folder of the test."""

from pathlib import Path

import pytest

from tests.export.made import model_of
from tests.scenes import Scene, primitive_scene


@pytest.fixture(scope="session")
def scene() -> Scene:
    return primitive_scene("box", pixels=70.0)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def model(scene: Scene) -> Path:
    """A model in the folder ``model`` of scans in the folder ``scans``."""
    return model_of(scene)
