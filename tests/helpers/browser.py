# SPDX-License-Identifier: BSD-3-Clause
"""What tests see and do in a browser that shows a report's page."""

import shutil
from contextlib import contextmanager

import numpy as np
import pytest

from reference.storage.exr import read_exr
from tests.helpers.page import HEIGHT, WIDTH


@contextmanager
def chromium():
    """Chromium, without a window; a test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser; see the dev extra")
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("no Chromium on this machine; Debian's package is chromium")
    with playwright.sync_playwright() as running:
        # As root, as in a container, Chromium's own sandbox cannot work.
        launched = running.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield launched
        launched.close()


def watched(browser, **options):
    """A new tab, and a list of all that it asks for, prints and throws."""
    opened = browser.new_page(viewport={"width": 1300, "height": 1000}, **options)
    told = []
    opened.on("console", lambda message: told.append(f"console {message.text}"))
    opened.on("pageerror", lambda error: told.append(f"error {error}"))
    opened.on("request", lambda request: told.append(f"request {request.url}"))
    return opened, told


def viewer(page, number=0):
    return page.locator(f"#viewer-{number}")


def drawn(page, number=0):
    return viewer(page, number).get_attribute("data-drawn")


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


def layer(folder, name, of="airlight"):
    return read_exr(folder / "s" / f"{name}.exr").layers[of].astype(np.float64)


def point_at(page, x, y, which="method", number=0):
    canvas = viewer(page, number).locator(f".{which} canvas")
    box = canvas.bounding_box()
    canvas.hover(position={"x": (x + 0.5) * box["width"] / WIDTH, "y": (y + 0.5) * box["height"] / HEIGHT})


def probe_row(page, label, number=0):
    rows = viewer(page, number).locator(".probe tbody tr")
    return next(
        cells[1:] for cells in (row.locator("th, td").all_inner_texts() for row in rows.all()) if cells[0] == label
    )


def as_number(words):
    mantissa, _, power = words.replace("\N{MINUS SIGN}", "-").removesuffix(" %").partition("·10")
    return float(mantissa) * 10.0 ** int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
