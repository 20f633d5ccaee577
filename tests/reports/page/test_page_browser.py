# SPDX-License-Identifier: BSD-3-Clause
"""The page in a real browser: its pictures, errors, probe and keys show what the files hold, and it loads nothing."""

import numpy as np
import pytest

from reports.page.render import render_page
from reports.plotting.pictures import error_map, tone_mapped
from tests.helpers.browser import as_number, drawn, layer, pixels, point_at, probe_row, viewer, watched
from tests.helpers.page import HEIGHT, WIDTH, small_report, write_files


@pytest.mark.slow
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
    for name, which in (("reference", "reference"), ("good", "method")):
        wanted = tone_mapped(layer(folder, name), 2.5).astype(int)
        # The table of sRGB has 16385 steps and the reference 16 digits: one level at most.
        assert np.abs(pixels(page, f"#viewer-0 .{which} canvas") - wanted).max() <= 1
    page.keyboard.press("2")
    assert drawn(page) == "1 airlight signed 0"
    wanted = error_map(layer(folder, "reference"), layer(folder, "flat")).astype(int)
    hole = np.zeros((HEIGHT, WIDTH), dtype=bool)
    hole[5, 7] = True
    # A step of the map where the coded difference falls on the other side of a bound.
    assert np.abs(pixels(page, "#viewer-0 .error canvas") - wanted)[~hole].max() <= 6
    viewer(page).locator("input[type=range]").fill("-2")
    wanted = tone_mapped(layer(folder, "reference"), 2.5 / 4).astype(int)
    page.wait_for_selector("#viewer-0[data-drawn$=' -2']")
    assert np.abs(pixels(page, "#viewer-0 .reference canvas") - wanted).max() <= 1
    point_at(page, 20, 10)
    shown = [as_number(words) for words in probe_row(page, "reference")[:3]]
    np.testing.assert_allclose(shown, layer(folder, "reference")[10, 20], rtol=5e-3)  # three digits are shown
    page.keyboard.press("f")
    assert not viewer(page).locator("figure.error").is_visible()
    page.close()
    assert told == [f"request {path.as_uri()}"]
