# SPDX-License-Identifier: BSD-3-Clause
"""The page of a report: report.json and its images as one self-contained HTML file.

Styles, scripts and images are put into the file: it opens without a network, in any recent browser.
The images go in as data (`reports.page.images`), decoded and drawn by the scripts in `templates/`.
"""

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError
from airlight.reports.data.records import Method, Report, Scene
from airlight.reports.page.chart import scene_chart, speed_error_chart
from airlight.reports.page.filters import (
    FILTERS,
    KINDS,
    MARKS,
    TABLES,
    kept_words,
    trust_words,
    viewer_words,
)
from airlight.reports.page.images import SceneImages, page_images
from airlight.reports.plotting.pictures import signed_colours, unsigned_colours
from airlight.reports.tables.methods import headline

if TYPE_CHECKING:
    import jinja2
    from markupsafe import Markup

PAGE_LIMIT = 30_000_000  #: bytes of a page
SCRIPTS = ("codec.js", "scene.js", "draw.js", "viewer.js", "page.js")
TEMPLATES = Path(__file__).parent / "templates"


def render_page(report: Report, folder: Path, *, limit: int = PAGE_LIMIT) -> str:
    """Return the HTML page of a report whose files lie in a folder; images are
    thinned out to keep the limit.
    """
    from markupsafe import Markup

    # A scene without any image has no viewer.
    with_images = [scene for scene in report.scenes if any(entry.files for entry in scene.methods)]
    # Everything but images gets 2.5 MB of the page.
    images = page_images(with_images, Path(folder), limit - 2_500_000)
    number_of = {id(scene): number for number, scene in enumerate(with_images)}
    # The scene that opens the page is drawn without a script too, and has the chart of methods
    # beside it.
    lead = _lead(
        report.scenes,
        [place for place, scene in enumerate(report.scenes) if id(scene) in number_of],
    )
    chart = "" if lead is None else Markup(scene_chart(report.scenes, lead))
    viewers = [
        _viewer(
            scene,
            number_of[id(scene)],
            images[number_of[id(scene)]],
            chart=chart if place == lead else "",
            folder=Path(folder) if place == lead else None,
        )
        if id(scene) in number_of
        else None
        for place, scene in enumerate(report.scenes)
    ]
    environment = page_environment()
    environment.globals |= TABLES
    # Styles, scripts and data go into the page: it opens without a network.
    page = environment.get_template("report.html.j2").render(
        report=report,
        viewers=viewers,
        lead=lead,
        headline="" if lead is None else headline(report.scenes[lead]),
        trust=trust_words(report.scenes),
        chart=Markup(speed_error_chart(report.scenes)) if report.scenes else "",
        css=template_text("report.css"),
        scripts=[template_text(name) for name in SCRIPTS],
        images=Markup(
            _script_json(
                {"scenes": [scene_images.index for scene_images in images], "maps": _maps()}
            )
        ),
        pixels=[Markup(scene_images.data) for scene_images in images],
        kept=kept_words(report),
    )
    # Words alone can exceed their part, with very many methods.
    if len(page.encode()) > limit:
        raise InputError(
            f"report: the page takes {len(page.encode()) / 1e6:.1f} MB, expected at most "
            f"{limit / 1e6:g} MB; "
            "report fewer scenes or methods at once"
        )
    return page


def page_environment() -> "jinja2.Environment":
    """Return the environment that renders the templates, with the filters
    and the marks of claims.
    """
    import jinja2

    # Values of a report come from files of users: everything is escaped, and a value that is
    # missing is a fault, no empty text.
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= FILTERS
    environment.globals |= {"kinds": KINDS, "marks": MARKS}
    return environment


def template_text(name: str) -> "Markup":
    """Return a style sheet or a script of the templates, to be put into a page as it is."""
    from markupsafe import Markup

    return Markup((TEMPLATES / name).read_text(encoding="utf-8"))


def _viewer(
    scene: Scene, number: int, images: SceneImages, *, chart: str, folder: Path | None
) -> dict[str, Any]:
    """Return the values of the template of a viewer; with a folder also its first
    pictures, which need no script.
    """
    shown = [entry for entry in scene.methods if entry.files]
    first = _first_shown(shown)
    files = shown[first].files
    # Pictures for readers without scripts, of the opening scene only.
    named = {
        "reference": scene.files.picture,
        "method": files.get("picture"),
        "error": files.get("error"),
    }
    return {
        "number": number,
        "shown": shown,
        "first": first,
        "pictures": {
            name: _inline(folder / file)
            for name, file in named.items()
            if folder and file and (folder / file).is_file()
        },
        "size": images.index["size"],
        "words": viewer_words(images.index),
        "chart": chart,
    }


def _inline(path: Path) -> str:
    """Return a PNG file as the address of a smaller picture that stands in the page."""
    import io

    from PIL import Image

    buffer = io.BytesIO()
    try:
        # A smaller copy: the PNG file lies beside the page in full.
        with Image.open(path) as picture:
            picture.convert("RGB").save(buffer, "WEBP", quality=80)
    except OSError as error:
        raise InputError(
            f"{path} is no picture that can be read ({error}); expected the PNG of a report: "
            "measure again"
        ) from None
    return f"data:image/webp;base64,{base64.b64encode(buffer.getvalue()).decode()}"


def _lead(scenes: Sequence[Scene], shown: Sequence[int]) -> int | None:
    """Return the place of the scene that opens the page: with the most edges between light
    and shadow; None for none.

    The first of equals is taken; `shown` are the places of the scenes that have images.
    """
    return max(shown, key=lambda place: scenes[place].reference.transitions, default=None)


def _first_shown(methods: Sequence[Method]) -> int:
    """Return the place of the method of median error: the error map of an exact method is white."""

    def error(place: int) -> float:
        rmse = getattr(methods[place].error, "relative_rmse", None)
        return float("inf") if rmse is None else rmse

    ranked = sorted(
        (place for place in range(len(methods)) if error(place) < float("inf")), key=error
    )
    return ranked[len(ranked) // 2] if ranked else 0


def _maps() -> dict[str, str]:
    """Return the colour maps by name, their bytes in base64."""
    maps = {
        "signed": signed_colours(),
        "relative": unsigned_colours("viridis"),
        "flip": unsigned_colours("magma"),
    }
    return {
        name: base64.b64encode(colours.tobytes()).decode("ascii") for name, colours in maps.items()
    }


def _script_json(value: Any) -> str:
    """Return JSON that can stand inside a script element: no tag can begin in it."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
