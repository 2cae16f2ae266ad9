"""The page of the API reference shows every public name, and no other."""

import re
from pathlib import Path

import scanweld

PAGE = Path(__file__).parents[1] / "docs" / "api.md"


def test_the_api_page_shows_every_public_name_once():
    shown = re.findall(r"^::: scanweld\.(\w+)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(shown) == sorted(scanweld.__all__)


def test_every_public_function_and_class_says_what_it_is():
    for name in scanweld.__all__:
        assert name == "Event" or getattr(scanweld, name).__doc__, name


def test_the_version_is_that_of_the_installed_package():
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", scanweld.__version__)
