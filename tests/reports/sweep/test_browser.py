# SPDX-License-Identifier: BSD-3-Clause
"""The page of a sweep in a real browser: for everybody, on small screens, on paper, without scripts."""

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


@pytest.mark.slow
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
