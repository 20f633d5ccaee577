# SPDX-License-Identifier: BSD-3-Clause
"""The page in a real browser: its pictures, error maps and probe show what the files hold."""

import numpy as np
import pytest

from reports.plotting.colour_maps import unsigned_colours
from reports.plotting.pictures import error_map, tone_mapped
from tests.helpers.browser import as_number, drawn, layer, pixels, point_at, probe_row, viewer
from tests.helpers.page import HEIGHT, WIDTH


def test_pictures_are_those_of_the_files(page, folder):
    for name, which in (("reference", "reference"), ("good", "method")):
        wanted = tone_mapped(layer(folder, name), 2.5).astype(int)
        # The table of sRGB has 16385 steps and the reference 16 digits: one level at most.
        assert np.abs(pixels(page, f"#viewer-0 .{which} canvas") - wanted).max() <= 1


def test_the_page_opens_with_pictures(page):
    """Truth, method, error, the strip of all errors and the chart lie in a window of 1300 x 1000."""
    assert page.viewport_size == {"width": 1300, "height": 1000}
    for shown in (".reference canvas", ".method canvas", ".error canvas", ".strip", ".speed .chart"):
        box = viewer(page).locator(shown).first.bounding_box()
        assert box["y"] + box["height"] <= 1000, shown


def test_a_point_of_the_chart_shows_its_image(page):
    assert drawn(page) == "0 airlight signed 0"
    page.locator("#point-1 use").first.click()
    assert drawn(page) == "1 airlight signed 0"
    assert page.locator("#point-1").get_attribute("class") == "chosen"


def test_error_map_is_that_of_the_pictures(page, folder):
    page.keyboard.press("2")
    assert drawn(page) == "1 airlight signed 0"
    wanted = error_map(layer(folder, "reference"), layer(folder, "flat")).astype(int)
    got = pixels(page, "#viewer-0 .error canvas")
    hole = np.zeros((HEIGHT, WIDTH), dtype=bool)
    hole[5, 7] = True
    # A step of the map where the coded difference falls on the other side of a bound.
    assert np.abs(got - wanted)[~hole].max() <= 6
    assert tuple(got[5, 7]) in {(255, 0, 255), (122, 0, 122)}
    assert "1 pixel not finite" in viewer(page).locator(".error .what").inner_text()


def test_an_error_map_without_colour_says_that_it_is_meant(page):
    """`good` is wrong by 3e-6: below 1e-4 everywhere, and not below 1e-6."""
    words = viewer(page).locator(".error .what")
    assert "all white: below 0.01 % in every pixel" in words.inner_text()
    page.keyboard.press("r")
    page.keyboard.press("r")
    assert "all white" not in words.inner_text()
    page.keyboard.press("2")
    assert "all white" not in words.inner_text()


def test_kinds_of_error_maps_follow_one_another(page, folder):
    page.keyboard.press("2")
    reference, flat = layer(folder, "reference"), layer(folder, "flat")
    page.keyboard.press("e")
    assert drawn(page) == "1 airlight relative 0"
    difference = np.abs(flat - reference) / np.maximum(reference, 1e-3 * reference.mean())
    size = np.clip(1 + np.log10(np.maximum(difference.max(axis=-1), 1e-30)) / 4, 0, 1)
    wanted = unsigned_colours("viridis")[np.round(255 * np.nan_to_num(size)).astype(int)].astype(int)
    got = pixels(page, "#viewer-0 .error canvas")
    lit = np.isfinite(size)
    assert np.abs(got - wanted)[lit].max() <= 6
    page.keyboard.press("e")
    assert drawn(page) == "1 airlight flip 0"
    levels = np.round(255 * layer(folder, "flat", "flip")[..., 0]).astype(int)
    np.testing.assert_array_equal(pixels(page, "#viewer-0 .error canvas"), unsigned_colours("magma")[levels])
    page.keyboard.press("e")
    assert drawn(page) == "1 airlight difference 0"
    wanted = tone_mapped(np.nan_to_num(np.abs(flat - reference)), 10 * 2.5).astype(int)
    assert np.abs(pixels(page, "#viewer-0 .error canvas") - wanted)[lit].max() <= 1
    assert "W/(m² sr)" in viewer(page).locator(".ticks").inner_text()
    page.keyboard.press("e")
    assert drawn(page) == "1 airlight signed 0"
    ticks = viewer(page).locator(".ticks span").all_inner_texts()
    assert ticks[0] == "\N{MINUS SIGN}100 %"
    assert ticks[len(ticks) // 2] == "±0.01 %"
    page.keyboard.press("r")
    assert "±0.001 %" in viewer(page).locator(".ticks").inner_text()


def test_probe_reads_all_images_at_once(page, folder):
    point_at(page, 20, 15)
    exact = layer(folder, "reference")[15, 20]
    for label, name in (("reference", "reference"), ("good (k)", "good"), ("flat", "flat")):
        red, green, blue, error, _ = probe_row(page, label)
        wanted = layer(folder, name)[15, 20]
        # 16 binary digits of the reference, five decimal digits shown, 1 / 2000 of the difference of a method.
        np.testing.assert_allclose([as_number(red), as_number(green), as_number(blue)], wanted, rtol=3e-4)
        if label != "reference":
            relative = wanted / exact - 1
            worst = relative[np.abs(relative).argmax()]
            assert as_number(error) == pytest.approx(100 * worst, rel=0.006, abs=6e-6)  # three digits, 5e-8
    assert probe_row(page, "flat")[4] == f"{layer(folder, 'flat', 'flip')[15, 20, 0]:.3f}"
    assert "Pixel (20, 15): airlight" in viewer(page).locator(".where").inner_text()


def test_probe_names_what_is_not_finite_and_a_click_holds_it(page):
    point_at(page, 7, 5)
    assert probe_row(page, "flat")[1] == "not a number"
    assert probe_row(page, "flat")[3] == "not finite"
    page.mouse.down()
    page.mouse.up()
    assert "not a number" in page.locator("#live").inner_text() or "good" in page.locator("#live").inner_text()
    point_at(page, 20, 15)
    assert "Pixel (7, 5), held" in viewer(page).locator(".where").inner_text()
    page.keyboard.press("Escape")
    point_at(page, 21, 15)
    assert "Pixel (21, 15): " in viewer(page).locator(".where").inner_text()


def test_arrow_keys_move_the_probe_of_a_focused_picture_and_it_is_spoken(page):
    viewer(page).locator(".reference canvas").focus()
    for key in ("ArrowRight", "ArrowRight", "ArrowDown", "Shift+ArrowLeft"):
        page.keyboard.press(key)
    where = viewer(page).locator(".where").inner_text()
    # The first key brings the probe to the middle.
    assert f"Pixel ({WIDTH // 2 + 1 - 10}, {HEIGHT // 2 + 1}), held" in where
    assert page.locator("#live").inner_text().startswith(f"Pixel {WIDTH // 2 - 9}, {HEIGHT // 2 + 1}. Reference ")
    assert drawn(page) == "0 airlight signed 0"  # the method stayed


def test_layers_follow_one_another(page, folder):
    for name in ("surface", "total"):
        page.keyboard.press("l")
        assert drawn(page) == f"0 {name} signed 0"
    total = layer(folder, "reference") + layer(folder, "reference", "surface")
    wanted = tone_mapped(total, 2.5).astype(int)
    assert np.abs(pixels(page, "#viewer-0 .method canvas") - wanted).max() <= 1


def test_image_without_layers_shows_its_total_and_says_so(page, folder):
    viewer(page, 1).locator("select[data-sets=method]").select_option("engine")
    page.wait_for_selector("#viewer-1[data-drawn='1 total signed 0']")
    assert "it has no airlight: its total is shown" in viewer(page, 1).locator(".method figcaption").inner_text()
    wanted = tone_mapped(layer(folder, "engine", "total"), 2.5).astype(int)
    assert np.abs(pixels(page, "#viewer-1 .method canvas") - wanted).max() <= 1
