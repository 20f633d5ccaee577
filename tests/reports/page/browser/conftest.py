# SPDX-License-Identifier: BSD-3-Clause
"""A page of two scenes, opened in a real browser."""

import pytest

from reports.page.render import render_page
from tests.helpers.browser import watched
from tests.helpers.page import engine_image, report_data, write_files
from tests.helpers.published import BILLETER, BIRI, MUTATIONS, STABILITY


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_files(tmp_path_factory.mktemp("browser"))


@pytest.fixture(scope="module")
def path(folder):
    """A page of two scenes; the second has an engine's image too, in place of the method `good`."""
    data = report_data()
    second = report_data()["scenes"][0] | {"name": "pens"}
    second["methods"] = [second["methods"][1], engine_image()]
    data["scenes"].append(second)
    data |= {"stability": STABILITY, "mutations": MUTATIONS, "published": {"biri": BIRI, "billeter": BILLETER}}
    page = folder / "report.html"
    page.write_text(render_page(data, folder), encoding="utf-8")
    return page


@pytest.fixture
def page(browser, path):
    """The page, opened; at the end nothing may have been loaded, printed or thrown."""
    opened, told = watched(browser)
    opened.goto(path.as_uri())
    opened.wait_for_selector("html[data-drawn]")
    yield opened
    opened.close()
    assert told == [f"request {path.as_uri()}"]
