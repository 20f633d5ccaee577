# SPDX-License-Identifier: BSD-3-Clause
"""The view in a real browser: mouse, keys and widgets change the picture, and the page says what it costs."""

import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.browser import chromium_processes, pixels, watched
from tests.reports.view.browser.conftest import changed, data, running, settled


def command(page, which="render"):
    page.select_option("#which", which)
    return page.inner_text("#command")


def write(page, label, text):
    page.fill(f'[aria-label="{label}"]', text)
    page.keyboard.press("Enter")


def dragged(page, by, button="left"):
    box = page.locator("#method").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down(button=button)
    page.mouse.move(x + by[0], y + by[1], steps=4)
    page.mouse.up(button=button)


def camera(page):
    """Origin and target, of the command."""
    words = command(page).split()
    values = dict(word.split("=") for word in words if word.startswith("camera."))
    return tuple(np.array([float(n) for n in values[f"camera.{name}"].split(",")]) for name in ("origin", "target"))


@pytest.mark.claim("view-camera")
def test_the_mouse_orbits_pans_comes_near_and_flies(page):
    first = pixels(page, "#method")
    changed(page, lambda: dragged(page, (12, 5)))
    assert np.abs(pixels(page, "#method") - first).mean() > 0.5
    origin, target = camera(page)
    changed(page, lambda: dragged(page, (9, 3)))
    turned, same = camera(page)
    np.testing.assert_allclose(same, target, atol=1e-5)
    assert np.linalg.norm(turned - target) == pytest.approx(np.linalg.norm(origin - target), rel=1e-5)
    assert np.linalg.norm(turned - origin) > 0.01
    changed(page, lambda: dragged(page, (9, 3), button="right"))
    panned, shifted = camera(page)
    np.testing.assert_allclose(panned - turned, shifted - same, atol=1e-5)
    assert np.linalg.norm(shifted - same) > 0.01
    page.locator("#method").hover()
    changed(page, lambda: page.mouse.wheel(0, -120))
    nearer, _ = camera(page)
    assert np.linalg.norm(nearer - shifted) < 0.95 * np.linalg.norm(panned - shifted)
    page.select_option("#mouse", "fly")
    changed(page, lambda: dragged(page, (9, 3)))
    still, looked = camera(page)
    np.testing.assert_allclose(still, nearer, atol=1e-5)
    assert np.linalg.norm(looked - shifted) > 0.01
    page.locator("#stage").focus()

    def forward():
        page.keyboard.down("w")
        page.wait_for_timeout(200)
        page.keyboard.up("w")

    changed(page, forward)
    flown, ahead = camera(page)
    along = (looked - still) / np.linalg.norm(looked - still)
    assert (flown - still) @ along == pytest.approx(np.linalg.norm(flown - still), rel=1e-3)
    assert (flown - still) @ along > 0.01
    np.testing.assert_allclose(ahead - flown, looked - still, atol=1e-4)


def test_keys_alone_move_the_camera(page):
    page.locator("#stage").focus()
    changed(page, lambda: page.keyboard.press("ArrowLeft"))
    origin, target = camera(page)
    changed(page, lambda: page.keyboard.press("+"))
    nearer, _ = camera(page)
    assert np.linalg.norm(nearer - target) < np.linalg.norm(origin - target)


@pytest.mark.claim("view-widgets")
def test_widgets_change_method_kernel_parameters_light_and_medium(page):
    changed(page, lambda: page.select_option("#choose-method", "ray-march"))
    assert "--method ray-march" in command(page)
    before = pixels(page, "#method")
    changed(page, lambda: write(page, "steps", "3"))
    assert "--set steps=3 " in command(page)
    assert float(data(page, "change")) > 0
    changed(page, lambda: page.select_option('[aria-label="spacing"]', "uniform"))
    assert "--set spacing=uniform" in command(page)
    assert np.abs(pixels(page, "#method") - before).max() > 1
    assert not page.locator("#kernel").is_visible()
    changed(page, lambda: page.select_option("#choose-method", "shadow-planes"))
    changed(page, lambda: page.select_option("#choose-kernel", "quadrature"))
    changed(page, lambda: page.locator("#kernel-size input").fill("8") or page.keyboard.press("Enter"))
    assert "--kernel quadrature-8" in command(page)
    dim = pixels(page, "#method").mean()
    changed(page, lambda: write(page, "light.intensity [W/sr], number 1", "670"))
    assert "--change light.intensity=670,71,83" in command(page)
    assert pixels(page, "#method")[..., 0].mean() > dim
    changed(page, lambda: write(page, "light.position [m], number 2", "0.35"))
    assert "--change light.position=0.37,0.35,4.31" in command(page)
    slider = page.locator('#lights .field:has([aria-label="medium.sigma_t [1/m]"]) input[type="range"]')
    changed(page, lambda: slider.evaluate("one => { one.value = 0.7; one.dispatchEvent(new Event('input')); }"))
    assert "--change medium.sigma_t=" in command(page, "reference")
    assert page.inner_text("#mistake") == ""


def test_a_mistake_is_said_and_what_was_there_stays(page):
    changed(page, lambda: page.select_option("#choose-method", "ray-march"))
    there = command(page)
    write(page, "steps", "0")
    page.wait_for_function("() => document.querySelector('#mistake').textContent !== ''")
    assert "steps: got 0, wanted a whole number of at least 1" in page.inner_text("#mistake")
    assert command(page) == there
    page.wait_for_function("""() => document.querySelector('[aria-label="steps"]').value === '100'""")


def test_a_number_that_is_half_typed_stays_when_something_else_changes(page):
    field = '[aria-label="light.intensity [W/sr], number 1"]'
    page.fill(field, "670")
    changed(page, lambda: page.evaluate("() => say('choose', {method: 'ray-march'})"))
    assert page.input_value(field) == "670"
    changed(page, lambda: page.keyboard.press("Enter"))
    assert "--change light.intensity=670,71,83" in command(page)
    assert "--method ray-march" in command(page)


@pytest.mark.claim("view-error", tolerance="none")
def test_the_error_converges_beside_the_truth(page):
    changed(page, lambda: page.select_option("#choose-method", "ray-march"))
    page.select_option("#beside", "truth")
    page.wait_for_selector("html[data-truth=done]", timeout=120_000)
    words = page.inner_text("#error")
    assert "3072 pixels" not in words
    assert "all pixels" in words
    assert "the truth's own bound" in words
    page.wait_for_function("() => document.querySelector('#other').dataset.known === '1'")
    method, truth = (pixels(page, f"#{name}") for name in ("method", "other"))
    assert np.abs(method - truth).mean() < 2
    page.locator("#wipe").fill("25")
    assert page.evaluate("getComputedStyle(document.querySelector('#other')).clipPath").startswith(
        "inset(0px 0px 0px 25%"
    )
    page.select_option("#layout", "side")
    boxes = [page.locator(f"#{name}").bounding_box() for name in ("method", "other")]
    assert boxes[1]["x"] >= boxes[0]["x"] + boxes[0]["width"]
    page.select_option("#beside", "error")
    page.wait_for_function("() => document.querySelector('#right').textContent === 'error of the airlight'")
    assert page.locator("#scale").is_visible()
    page.select_option("#beside", "none")
    assert not page.locator("#other").is_visible()


def test_it_says_frames_and_milliseconds_by_stage(page):
    page.check("#run")
    page.wait_for_function("() => +document.documentElement.dataset.fps > 1", timeout=60_000)
    rows = dict(row.locator("th, td").all_inner_texts() for row in page.locator("#times tbody tr").all())
    page.uncheck("#run")
    settled(page)  # a page that closes sooner leaves the next one with frames without end
    assert {"airlight", "picture", "in the browser", "all"} <= set(rows)
    assert all(float(milliseconds) >= 0 for milliseconds in rows.values())


def test_axe_finds_nothing(page):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe checks the page; see the dev extra")
    page.select_option("#beside", "error")
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        found = axe.Axe().run(page)
        assert found.violations_count == 0, found.generate_report()


def test_a_second_tab_takes_over(browser, address):
    first, _ = watched(browser)
    first.goto(address)
    first.wait_for_selector("html[data-frame]")
    second, _ = watched(browser)
    second.goto(address)
    second.wait_for_selector("html[data-frame]")
    first.wait_for_selector("html[data-ended]")
    assert "opened in another tab" in first.inner_text("#mistake")
    first.close()
    second.close()


def _processor_seconds(pids):
    total = 0
    for pid in pids:
        try:
            fields = Path(f"/proc/{pid}/stat").read_text(errors="replace").rsplit(")", 1)[1].split()
        except OSError:
            continue
        total += int(fields[11]) + int(fields[12])
    return total / 100


def _drawing(browser, *arguments, drag):
    """Seconds of processors for a frame, of the view and of the browser, while the camera moves or nothing does."""
    with running(*arguments) as (process, printed):
        opened, _ = watched(browser)
        opened.goto(printed)
        opened.wait_for_selector("html[data-frame]")
        box = opened.locator("#method").bounding_box()
        x, y = box["x"] + 320, box["y"] + 240
        if drag:
            opened.mouse.move(x, y)
            opened.mouse.down()
        else:
            opened.check("#run")

        def turn(seconds):
            stop = time.monotonic() + seconds
            while (left := stop - time.monotonic()) > 0:
                if drag:
                    opened.mouse.move(x + 30 * np.sin(3 * left), y + 8 * np.cos(3 * left))
                opened.wait_for_timeout(15 if drag else 200)

        turn(3)  # everything is recorded then
        parts = [process.pid], chromium_processes()
        frames, seconds = int(data(opened, "frame")), [_processor_seconds(part) for part in parts]
        turn(8)
        drawn = int(data(opened, "frame")) - frames
        each = [(_processor_seconds(part) - before) / drawn for part, before in zip(parts, seconds, strict=True)]
        opened.close()
    own, shown = (1e3 * seconds for seconds in each)
    print(
        f"{' '.join(arguments)}: {drawn / 8:.1f} frames a second; processors, ms: view {own:.1f}, browser {shown:.1f}"
    )
    return each


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the processor's time of other processes is read from /proc")
@pytest.mark.claim("view-15-frames", tolerance="none: the sum of both for 15 frames is below 2 s")
def test_two_processors_have_time_for_fifteen_frames_a_second(browser):
    """Time of processors, as other work on the machine changes how many frames a second has.

    What the browser takes for a frame is measured where the method takes next to nothing: else it is mostly its time
    between frames.
    """
    view, _ = _drawing(browser, "colonnade", "--method", "shadow-planes", "--size", "640x480", drag=True)
    _, page = _drawing(browser, "sphere-spot", "--method", "unshadowed", "--size", "640x480", drag=False)
    assert 15 * (view + page) < 2
