# SPDX-License-Identifier: BSD-3-Clause
"""The page of a report: report.json and its pictures as one self-contained HTML file."""

import base64
from pathlib import Path
from typing import Any

from reports.charts import speed_error_chart
from reports.pictures import ERROR_CEILING, ERROR_FLOOR, error_scale, png_bytes


def render_page(data: dict[str, Any], folder: Path) -> str:
    """Return the HTML page of a report.

    Parameters
    ----------
    data
        The content of report.json.
    folder
        Where the pictures that it names lie.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"percent": _percent, "number": _number, "interval": _interval}

    def picture(name: str) -> str:
        return "data:image/png;base64," + base64.b64encode((folder / name).read_bytes()).decode("ascii")

    return environment.get_template("report.html.j2").render(
        report=data,
        picture=picture,
        chart=speed_error_chart(data["scenes"]),
        scale="data:image/png;base64," + base64.b64encode(png_bytes(error_scale())).decode("ascii"),
        error_floor=ERROR_FLOOR,
        error_ceiling=ERROR_CEILING,
    )


def _number(value: float | None, digits: int = 3) -> str:
    """Return a number with some significant digits, an en dash for none."""
    if value is None:
        return "\N{EN DASH}"
    text = f"{value:.{digits - 1}e}" if 0 < abs(value) < 1e-3 else f"{value:.{digits}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        return f"{mantissa}·10{_superscript(int(exponent))}"
    return text


def _percent(value: float | None, digits: int = 3) -> str:
    return "\N{EN DASH}" if value is None else f"{_number(100 * value, digits)} %"


def _interval(pair: list[float | None] | None) -> str:
    """Return an interval of relative values in per cent."""
    if pair is None or pair[0] is None or pair[1] is None:
        return "\N{EN DASH}"
    return f"{100 * pair[0]:+.3f} … {100 * pair[1]:+.3f} %"


def _superscript(value: int) -> str:
    return str(value).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
