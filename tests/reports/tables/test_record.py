# SPDX-License-Identifier: BSD-3-Clause
"""A result shows the same on a terminal, in a notebook and as JSON; no JSON has a
number that is not finite.
"""

import io
import json
import math
import sys
from dataclasses import dataclass

import pytest

import airlight
from airlight.errors import InputError
from airlight.reference.storage.build import build
from airlight.reports.tables.record import Result, picture, print_json
from airlight.reports.tables.table import numbers, table


@dataclass(frozen=True, eq=False, repr=False)
class Checked(Result):
    """A check of a scene, with everything that a result can say."""

    error: float
    wrong: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()

    title = scene_name = "a <scene>"
    claims = ("`exact` is 1 % off.",)
    tables = (table("Times", numbers("frame"), [(1.5,)]),)
    lines = ("wrote `a.exr`",)
    notes = ("a sun",)

    @property
    def faults(self):
        return self.broken

    @property
    def failures(self):
        return [*self.broken, *self.wrong]


def test_a_result_has_its_claims_tables_and_lines_wherever_it_is_shown():
    shown = Checked(0.5)
    lines = [line.strip() for line in shown.text().splitlines()]
    assert lines[:2] == ["- exact is 1 % off.", "Times"]
    assert lines[-4:] == ["1.5", "", "", "wrote `a.exr`"]
    notebook = shown._repr_html_()
    assert "<strong>a &lt;scene&gt;</strong>" in notebook
    assert "<li><code>exact</code> is 1 % off.</li>" in notebook
    assert ">1.5</th>" in notebook
    assert "<li>wrote <code>a.exr</code></li>" in notebook
    assert repr(shown) == "Checked(a <scene>)"


@pytest.mark.claim("exit-status")
@pytest.mark.parametrize(
    ("wrong", "broken", "status"), [((), (), 0), (("late",), (), 1), ((), ("no light",), 1)]
)
def test_the_status_is_one_where_a_check_failed_or_something_is_at_fault(wrong, broken, status):
    said = Checked(0.5, wrong, broken)
    assert (said.passed, said.status) == (status == 0, status)


def test_every_command_prints_json_of_one_shape():
    printed = Checked(math.nan, ("late",), ("no light",)).enveloped(
        "airlight check", output="a.exr"
    )
    assert printed == {
        "schema": 1,
        "command": "airlight check",
        "airlight": airlight.__version__,
        "commit": build().commit,
        "scene": "a <scene>",
        "result": {"error": None, "wrong": ["late"], "broken": ["no light"], "output": "a.exr"},
        "notes": ["a sun"],
        "failures": ["no light", "late"],
    }


@pytest.mark.parametrize("value", [float("nan"), float("inf"), [{"mean": float("-inf")}]])
def test_a_number_that_is_not_finite_is_refused_rather_than_printed_as_no_json(value, capsys):
    with pytest.raises(InputError, match="a result is not finite, and is not printed"):
        print_json({"value": value})
    assert capsys.readouterr().out == ""
    print_json({"value": None, "name": "\N{GREEK SMALL LETTER SIGMA}"})
    assert json.loads(capsys.readouterr().out) == {
        "value": None,
        "name": "\N{GREEK SMALL LETTER SIGMA}",
    }


def test_json_on_an_output_of_ascii_has_every_letter_in_ascii(monkeypatch):
    written = io.BytesIO()
    with io.TextIOWrapper(written, encoding="ascii") as output:
        monkeypatch.setattr(sys, "stdout", output)
        print_json({"name": "\N{GREEK SMALL LETTER SIGMA}"})
        output.flush()
        assert json.loads(written.getvalue().decode("ascii")) == {
            "name": "\N{GREEK SMALL LETTER SIGMA}"
        }


@pytest.mark.parametrize(("width", "shown"), [(6, 240), (100, 300), (240, 240), (320, 320)])
def test_single_pixels_of_a_small_picture_can_be_seen(width, shown):
    figure = picture(b"\x89PNG", width, alt="a <b>", caption="c & d")
    assert f"width:{shown}px" in figure
    assert ("image-rendering:pixelated" in figure) is (width < 240)
    assert 'src="data:image/png;base64,iVBORw=="' in figure
    assert 'alt="a &lt;b&gt;"' in figure
    assert "<figcaption>c &amp; d</figcaption>" in figure
