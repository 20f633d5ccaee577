# SPDX-License-Identifier: BSD-3-Clause
"""The page in a real browser: what keys, buttons, slider and lists do."""

import numpy as np

from reports.plotting.pictures import tone_mapped
from tests.helpers.browser import drawn, layer, pixels, viewer


def test_number_and_arrow_keys_choose_the_method(page):
    assert drawn(page) == "0 airlight signed 0"
    page.keyboard.press("2")
    assert drawn(page) == "1 airlight signed 0"
    assert "flat" in page.locator("#live").inner_text()
    page.keyboard.press("ArrowRight")
    assert drawn(page) == "0 airlight signed 0"
    page.keyboard.press("ArrowLeft")
    assert drawn(page) == "1 airlight signed 0"
    page.keyboard.press("9")  # there is none
    assert drawn(page) == "1 airlight signed 0"
    assert viewer(page).locator("select[data-sets=method]").input_value() == "1"


def test_flip_shows_reference_and_method_in_the_same_place(page):
    def shown():
        return [
            name for name in ("reference", "method", "error") if viewer(page).locator(f"figure.{name}").is_visible()
        ]

    assert shown() == ["reference", "method", "error"]
    page.keyboard.press("f")
    assert shown() == ["method"]
    place = viewer(page).locator(".method canvas").bounding_box()
    page.keyboard.press("f")
    assert shown() == ["reference"]
    assert viewer(page).locator(".reference canvas").bounding_box() == place
    page.keyboard.press("f")
    assert shown() == ["method"]
    page.keyboard.press("v")
    assert shown() == ["reference", "method", "error"]
    viewer(page).get_by_role("button", name="error map").click()
    assert shown() == ["error"]


def test_slider_exposes_every_scene_or_one(page, folder):
    slider = viewer(page).locator("input[type=range]")
    slider.fill("-2")
    page.wait_for_selector("#viewer-1[data-drawn$=' -2']")
    assert drawn(page) == "0 airlight signed -2"
    wanted = tone_mapped(layer(folder, "reference"), 2.5 / 4).astype(int)
    assert np.abs(pixels(page, "#viewer-0 .reference canvas") - wanted).max() <= 1
    viewer(page).locator("input[name=all]").uncheck()
    assert not viewer(page, 1).locator("input[name=all]").is_checked()
    slider.fill("1.5")
    assert drawn(page) == "0 airlight signed 1.5"
    assert viewer(page).locator("output").inner_text() == "+1.5 stops"
    page.wait_for_timeout(100)
    assert drawn(page, 1).endswith(" -2")


def test_keys_expose_and_reset(page):
    for _ in range(3):
        page.keyboard.press("+")
    page.keyboard.press("-")
    assert drawn(page) == "0 airlight signed 1"
    page.keyboard.press("0")
    assert drawn(page) == "0 airlight signed 0"


def test_method_without_flip_offers_none(page):
    assert viewer(page).locator("option[value=flip]").is_disabled()
    page.keyboard.press("2")
    assert viewer(page).locator("option[value=flip]").is_enabled()


def test_strip_shows_all_error_maps_and_chooses(page):
    page.wait_for_selector("#viewer-0[data-complete]")
    assert len(np.unique(pixels(page, "#viewer-0 .strip li:nth-child(2) canvas").reshape(-1, 3), axis=0)) > 5
    viewer(page).locator(".strip button").nth(1).click()
    assert drawn(page) == "1 airlight signed 0"


def test_method_chosen_in_one_scene_is_chosen_where_another_has_it(page):
    viewer(page, 1).locator("select[data-sets=method]").select_option("engine")
    page.keyboard.press("0")
    assert drawn(page).startswith("0 ")
    viewer(page, 1).locator("select[data-sets=method]").select_option("flat")
    page.wait_for_function("document.querySelector('#viewer-0').dataset.drawn.startsWith('1 ')")


def test_help_lists_the_keys_and_turns_them_off(page):
    page.keyboard.press("?")
    assert page.locator("#help").is_visible()
    assert "exposure" in page.locator("#help").inner_text()
    page.keyboard.press("2")  # nothing behind the help moves
    assert drawn(page) == "0 airlight signed 0"
    page.locator("#keys-on").uncheck()
    page.keyboard.press("Escape")
    assert not page.locator("#help").is_visible()
    page.keyboard.press("2")
    assert drawn(page) == "0 airlight signed 0"


def test_keys_are_left_to_whom_they_belong(page):
    slider = viewer(page).locator("input[type=range]")
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert drawn(page) == "0 airlight signed 0.25"  # exposed, not the next method
    page.keyboard.press("Control+f")
    assert viewer(page).locator("figure.reference").is_visible()


def test_colours_can_be_chosen(page):
    def ground():
        return page.evaluate("getComputedStyle(document.body).backgroundColor")

    light = ground()
    page.locator("#theme").select_option("dark")
    assert ground() != light
