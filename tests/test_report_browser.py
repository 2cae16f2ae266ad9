"""report.html in a real browser: it opens offline, draws the model, and can be used by keyboard.

Needs chromium and its driver (Debian: ``apt-get install chromium chromium-driver``) and the Python
package selenium; without them these tests are skipped.
"""

import io
import os
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from scanweld.app.html_report import write_html_report
from scanweld.reconstruction import Verdict
from tests.model_folders import crowd, good_result, small_scene, whole_folder, written

pytestmark = pytest.mark.slow

WAIT_SECONDS = 60.0
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
)
"""Software WebGL, so that it draws the same on machines without a graphics card."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs the package selenium")
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("needs a browser: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in FLAGS:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=driver)
    opened = webdriver.Chrome(options=options, service=service)
    opened.execute_cdp_cmd("Network.enable", {})
    opened.execute_cdp_cmd("Network.emulateNetworkConditions", OFFLINE)
    yield opened
    opened.quit()


OFFLINE = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = whole_folder(tmp_path_factory.mktemp("browser"))
    return write_html_report(made.folder, made.scans)


def show(browser: Any, page: Path, *, width: int = 1600, scheme: str = "light") -> None:
    """Open the page and wait until the model is drawn."""
    size = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
    media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    browser.get(page.as_uri())
    until(browser, "return document.getElementById('view').dataset.drawn")


def until(browser: Any, script: str) -> Any:
    """What a script returns once that is anything."""
    end = time.monotonic() + WAIT_SECONDS
    while time.monotonic() < end:
        if found := browser.execute_script(script):
            return found
        time.sleep(0.05)
    shown = browser.execute_script("return document.getElementById('view-message').textContent")
    return pytest.fail(f"{script} gave nothing; the page says {shown!r}")


def after_drawing(browser: Any, script: str) -> np.ndarray:
    """The canvas as a picture (H, W, 3), once it is drawn anew after a script."""
    drawn = browser.execute_script("return document.getElementById('view').dataset.drawn")
    browser.execute_script(script)
    until(browser, f"return document.getElementById('view').dataset.drawn !== '{drawn}'")
    return picture(browser)


def picture(browser: Any) -> np.ndarray:
    canvas = browser.find_element("id", "view")
    browser.execute_script(
        "arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", canvas
    )
    return np.asarray(Image.open(io.BytesIO(canvas.screenshot_as_png)).convert("RGB"), float)


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the pixels that differ clearly."""
    return float((np.abs(a - b).max(axis=2) > 24).mean())


def key(name: str) -> str:
    return (
        f"document.getElementById('view').dispatchEvent(new KeyboardEvent('keydown', "
        f"{{key: '{name}', bubbles: true, cancelable: true}}))"
    )


def mode(name: str) -> str:
    return f"document.querySelector('input[value={name}]').click()"


@pytest.mark.parametrize("width", [400, 1600])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_page_fits_and_nothing_goes_wrong(browser: Any, page: Path, width: int, scheme: str):
    show(browser, page, width=width, scheme=scheme)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    assert browser.get_log("browser") == []
    assert (
        browser.execute_script("return document.getElementById('view-message').textContent") == ""
    )
    background = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    lightness = np.mean([float(part) for part in background.strip("rgb()").split(",")])
    assert (lightness > 128) == (scheme == "light")


def test_a_page_of_given_poses_goes_without_pairs(browser: Any, tmp_path: Path):
    scene = small_scene()
    given = replace(good_result(scene), pairs=(), verdict=Verdict.GIVEN)
    folder = written(tmp_path / "fused", given)
    show(browser, write_html_report(folder, {scan.name: scan for scan in scene.scans}))
    assert browser.get_log("browser") == []
    assert "poses that were given" in browser.find_element("tag name", "h1").text
    links = browser.find_elements("css selector", "nav a")
    for link in links:
        assert browser.find_elements("css selector", link.get_dom_attribute("href"))
    assert not {"View graph", "Contours"} & {link.text for link in links}


def test_the_model_is_drawn_turned_and_reset(browser: Any, page: Path):
    show(browser, page)
    start = picture(browser)
    middle = start[start.shape[0] // 4 : -start.shape[0] // 4]
    assert middle.std() > 15  # a blank canvas has the background's faint gradient only
    turned = after_drawing(browser, key("ArrowRight") + ";" + key("ArrowDown"))
    assert difference(start, turned) > 0.01
    back = after_drawing(browser, "document.getElementById('reset').click()")
    assert difference(start, back) < 0.001
    closer = after_drawing(browser, key("+") + ";" + key("+"))
    assert difference(start, closer) > 0.01


def test_modes_show_different_things_and_their_legends(browser: Any, page: Path):
    show(browser, page)
    pictures = [picture(browser)]
    for name in ("scans", "residual", "support"):
        pictures.append(after_drawing(browser, mode(name)))
        legends = "return [...document.querySelectorAll('.legend > [data-mode]')]"
        shown = browser.execute_script(
            f"{legends}.filter((part) => !part.hidden).map((part) => part.dataset.mode)"
        )
        assert shown == [name]
    for k, one in enumerate(pictures):
        for other in pictures[:k]:
            assert difference(one, other) > 0.02


def test_a_scan_can_be_hidden(browser: Any, page: Path):
    show(browser, page)
    all_scans = after_drawing(browser, mode("scans"))
    hidden = after_drawing(browser, "document.querySelector('button[data-scan]').click()")
    assert difference(all_scans, hidden) > 0.01
    pressed = "return document.querySelector('button[data-scan]').getAttribute('aria-pressed')"
    assert browser.execute_script(pressed) == "false"


def test_tips_define_numbers_and_give_reasons(browser: Any, page: Path):
    show(browser, page)
    browser.execute_script("document.querySelector('#scans [data-def=rms]').focus()")
    tip = "const tip = document.getElementById('tip'); return tip.hidden ? '' : tip.textContent"
    assert until(browser, tip).startswith("root mean square")
    browser.execute_script("document.querySelector('#matrix td[tabindex=\"0\"]').focus()")
    first = browser.execute_script("return document.getElementById('pair-detail').textContent")
    assert "scan_01 – scan_02: accepted" in first and "agree 50.0 %" in first
    assert "scan_01 – scan_02" in until(browser, tip)
    browser.execute_script(
        "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', "
        "{key: 'ArrowRight', bubbles: true}))"
    )
    second = browser.execute_script("return document.getElementById('pair-detail').textContent")
    assert "scan_01 – scan_03" in second


def test_the_table_of_scans_can_be_sorted(browser: Any, page: Path):
    show(browser, page)
    names = (
        "return [...document.querySelectorAll('#scan-table tbody th')].map((th) => th.innerText)"
    )
    before = browser.execute_script(names)
    click = "document.querySelector('#scan-table th button').click()"
    browser.execute_script(click + ";" + click)
    assert browser.execute_script(names) == before[::-1]


def test_sixty_scans_fit(browser: Any, tmp_path: Path):
    folder = crowd(tmp_path, [f"turn_{k:02d}" for k in range(60)])
    page = write_html_report(folder)
    for width in (400, 1600):
        show(browser, page, width=width)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    assert browser.get_log("browser") == []
