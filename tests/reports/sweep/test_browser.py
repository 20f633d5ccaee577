# SPDX-License-Identifier: BSD-3-Clause
"""The page of a sweep in a real browser: for everybody, on small screens, on paper, without scripts."""

import re

import pytest

from reports.page.chart import svg_text
from reports.sweep.figures import drawn
from reports.sweep.page import render_sweep
from reports.sweep.read import FILE, read_sweep
from reports.sweep.summary import summary_of
from tests.helpers.browser import watched
from tests.helpers.sweeps import faulty_rows, write_rows


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    said = summary_of(read_sweep(write_rows(folder / FILE, faulty_rows())))
    page = folder / "sweep.html"
    page.write_text(render_sweep(said, {name: svg_text(figure, name) for name, figure in drawn(said)}), "utf-8")
    return page


@pytest.mark.claim("sweep-page-stands-alone")
@pytest.mark.parametrize(("scheme", "width"), [("light", 1300), ("dark", 390)])
def test_axe_finds_nothing_and_nothing_is_loaded(browser, path, scheme, width):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe checks the page; see the dev extra")
    opened, told = watched(browser, color_scheme=scheme)
    opened.set_viewport_size({"width": width, "height": 900})
    opened.goto(path.as_uri())
    checked = axe.Axe().run(opened)
    opened.close()
    assert checked.violations_count == 0, checked.generate_report()
    assert [message for message in told if not message.startswith(("request file:", "request data:"))] == []


def test_nothing_is_wider_than_a_telephone(browser, path):
    opened, _ = watched(browser)
    opened.set_viewport_size({"width": 360, "height": 700})
    opened.goto(path.as_uri())
    opened.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    assert opened.evaluate("document.documentElement.scrollWidth") <= 360
    opened.close()


def test_worst_scenes_unfold_and_their_pictures_are_drawn(browser, path):
    opened, _ = watched(browser)
    opened.goto(path.as_uri())
    last = opened.locator("details.worst").last
    assert not last.locator("img").first.is_visible()
    last.locator("summary").click()
    picture = last.locator("img").first
    picture.scroll_into_view_if_needed()
    assert picture.is_visible()
    opened.wait_for_function("(image) => image.complete && image.naturalWidth === 48", arg=picture.element_handle())
    opened.close()


def test_paper_and_readers_without_scripts_have_the_numbers(browser, path):
    context = browser.new_context(java_script_enabled=False)
    opened = context.new_page()
    opened.goto(path.as_uri())
    assert "within 1e-3" in opened.locator("body").inner_text()
    assert not opened.locator(".settings").is_visible()
    document = opened.pdf()
    assert len(re.findall(rb"/Type\s*/Page\b", document)) >= 2
    context.close()
