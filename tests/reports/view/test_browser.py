# SPDX-License-Identifier: BSD-3-Clause
"""The view of a small scene, as its command shows it, in a real browser: mouse, widgets, reference, a second tab."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.browser import pixels, watched

ROOT = Path(__file__).resolve().parents[3]


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


@pytest.mark.slow
@pytest.mark.claim("view-camera", "view-widgets")
def test_the_page_moves_changes_and_shows_the_error(browser):
    arguments = [sys.executable, str(ROOT / "airlight.py"), "view", "sphere-spot", "--size", "64x48"]
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
        changed(page, lambda: page.fill('[aria-label="steps"]', "30") or page.keyboard.press("Enter"))
        assert "--method ray-march" in command(page)
        assert "--set steps=30 " in command(page)
        page.fill('[aria-label="steps"]', "0")
        page.keyboard.press("Enter")
        page.wait_for_function("() => document.querySelector('#mistake').textContent.includes('steps: got 0')")
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
        process.communicate(timeout=30)
