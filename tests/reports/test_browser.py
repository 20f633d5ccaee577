# SPDX-License-Identifier: BSD-3-Clause
"""The page of a report and the view in a real browser: what they show is what files
hold, and they load nothing.
"""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from airlight.reference.storage.exr import read_exr
from airlight.reports.page.render import render_page
from airlight.reports.plotting.pictures import error_map, tone_mapped
from tests.helpers.page import HEIGHT, WIDTH, small_report, write_files

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser():
    """Chromium, without a window; a test is skipped where there is none."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright drives the browser; see the extra `test`"
    )
    path = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    if path is None:
        pytest.skip("no Chromium on this machine; Debian's package is chromium")
    with playwright.sync_playwright() as running:
        # As root, as in a container, Chromium's own sandbox cannot work.
        launched = running.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield launched
        launched.close()


def watched(browser):
    """A new tab, and a list of all that it asks for, prints and throws."""
    opened = browser.new_page(viewport={"width": 1300, "height": 1000})
    told = []
    opened.on("console", lambda message: told.append(f"console {message.text}"))
    opened.on("pageerror", lambda error: told.append(f"error {error}"))
    opened.on("request", lambda request: told.append(f"request {request.url}"))
    return opened, told


def pixels(page, selector):
    """The pixels of a canvas, (height, width, 3)."""
    size, values = page.evaluate(
        """(selector) => {
          const shown = document.querySelector(selector);
          const {width, height} = shown;
          const copy = Object.assign(document.createElement("canvas"), {width, height});
          const context = copy.getContext("2d", {willReadFrequently: true});
          context.drawImage(shown, 0, 0);
          return [[height, width], [...context.getImageData(0, 0, width, height).data]];
        }""",
        selector,
    )
    return np.array(values, dtype=np.uint8).reshape(*size, 4)[..., :3].astype(int)


def layer(folder, name):
    return read_exr(folder / "s" / f"{name}.exr").layers["airlight"].astype(np.float64)


def as_number(words):
    mantissa, _, power = words.replace("\N{MINUS SIGN}", "-").removesuffix(" %").partition("·10")
    return float(mantissa) * 10.0 ** int(
        power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0
    )


@pytest.mark.claim("report-stands-alone")
def test_the_page_shows_what_the_files_hold(browser, tmp_path):
    folder = write_files(tmp_path)
    path = folder / "report.html"
    path.write_text(render_page(small_report(), folder), encoding="utf-8")
    page, told = watched(browser)
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-drawn]")
    page.keyboard.press("1")  # the page opens on the method of median error
    page.wait_for_selector("#viewer-0[data-drawn^='0 ']")
    viewer = page.locator("#viewer-0")
    for name, which in (("reference", "reference"), ("good", "method")):
        wanted = tone_mapped(layer(folder, name), 2.5).astype(int)
        # The table of sRGB has 16385 steps and the reference 16 digits: one level at most.
        assert np.abs(pixels(page, f"#viewer-0 .{which} canvas") - wanted).max() <= 1
    page.keyboard.press("2")
    assert viewer.get_attribute("data-drawn") == "1 airlight signed 0"
    wanted = error_map(layer(folder, "reference"), layer(folder, "flat")).astype(int)
    hole = np.zeros((HEIGHT, WIDTH), dtype=bool)
    hole[5, 7] = True
    # A step of the map where the coded difference falls on the other side of a bound.
    assert np.abs(pixels(page, "#viewer-0 .error canvas") - wanted)[~hole].max() <= 6
    viewer.locator("input[type=range]").fill("-2")
    wanted = tone_mapped(layer(folder, "reference"), 2.5 / 4).astype(int)
    page.wait_for_selector("#viewer-0[data-drawn$=' -2']")
    assert np.abs(pixels(page, "#viewer-0 .reference canvas") - wanted).max() <= 1
    canvas = viewer.locator(".method canvas")
    box = canvas.bounding_box()
    canvas.hover(position={"x": 20.5 * box["width"] / WIDTH, "y": 10.5 * box["height"] / HEIGHT})
    rows = [
        row.locator("th, td").all_inner_texts() for row in viewer.locator(".probe tbody tr").all()
    ]
    (probed,) = (cells[1:4] for cells in rows if cells[0] == "reference")
    shown = [as_number(words) for words in probed]
    # three digits are shown
    np.testing.assert_allclose(shown, layer(folder, "reference")[10, 20], rtol=5e-3)
    page.keyboard.press("f")
    assert not viewer.locator("figure.error").is_visible()
    page.close()
    assert told == [f"request {path.as_uri()}"]


def changed(page, do):
    """Do something, and wait until a new frame is there and nothing follows."""
    before = int(page.evaluate("document.documentElement.dataset.frame"))
    do()
    page.wait_for_function("before => +document.documentElement.dataset.frame > before", arg=before)
    page.wait_for_function(
        """() => {
            const {frame, told} = document.documentElement.dataset, now = performance.now();
            const last = (window.settling ??= {});
            if (last.frame !== frame || last.told !== told) Object.assign(last, {frame, told, since: now});
            return now - last.since > 300;
        }"""
    )


def command(page):
    page.select_option("#which", "render")
    return page.inner_text("#command")


@pytest.mark.claim("view-camera", "view-widgets")
def test_the_view_moves_changes_and_shows_the_error(browser):
    arguments = [sys.executable, "-m", "airlight", "view", "sphere-spot", "--size", "64x48"]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        address = process.stdout.readline().strip()
        page, told = watched(browser)
        page.goto(address)
        page.wait_for_selector("html[data-frame][data-told]")
        first = pixels(page, "#method")

        def dragged():
            box = page.locator("#method").bounding_box()
            page.mouse.move(box["x"] + 32, box["y"] + 24)
            page.mouse.down()
            page.mouse.move(box["x"] + 44, box["y"] + 29, steps=4)
            page.mouse.up()

        changed(page, dragged)
        assert np.abs(pixels(page, "#method") - first).mean() > 0.5
        assert "--change camera.origin=" in command(page)
        changed(page, lambda: page.select_option("#choose-method", "ray-march"))
        changed(
            page, lambda: page.fill('[aria-label="steps"]', "30") or page.keyboard.press("Enter")
        )
        assert "--method ray-march" in command(page)
        assert "--set steps=30 " in command(page)
        page.fill('[aria-label="steps"]', "0")
        page.keyboard.press("Enter")
        page.wait_for_function(
            "() => document.querySelector('#mistake').textContent.includes('steps: got 0')"
        )
        page.select_option("#beside", "reference")
        page.wait_for_selector("html[data-reference=done]", timeout=120_000)
        assert "all pixels" in page.inner_text("#error")
        assert np.abs(pixels(page, "#method") - pixels(page, "#other")).mean() < 2
        second, _ = watched(browser)
        second.goto(address)
        page.wait_for_selector("html[data-ended]")
        asked = {word.removeprefix("request ") for word in told if word.startswith("request ")}
        assert [word for word in told if not word.startswith("request ")] == []
        assert {word for word in asked if not word.startswith("data:")} == {
            address + file for file in ("", "view.js", "view.css")
        }
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
