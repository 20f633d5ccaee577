# SPDX-License-Identifier: BSD-3-Clause
"""The page and the figures of a sweep, from its Parquet alone."""

import json
import re
from itertools import islice

import pytest

from airlight.reports.commands.main import run
from airlight.reports.page.chart import svg_text
from airlight.reports.sweep.page import drawn_figures, render_sweep, write_sweep
from airlight.reports.sweep.samples import FILE, read_sweep
from airlight.reports.sweep.summary import summary_of
from airlight.validation.columns import plain
from tests.helpers.page import Page
from tests.helpers.sweeps import METHODS, faulty_rows, row, rows, write_rows


def said_of(folder, several):
    return summary_of(read_sweep(write_rows(folder / FILE, several)))


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    return said_of(tmp_path_factory.mktemp("sweep"), faulty_rows())


@pytest.fixture(scope="module")
def charts(said):
    return {name: svg_text(figure, name) for name, figure in islice(drawn_figures(said), 1)}


@pytest.fixture(scope="module")
def page(said, charts):
    return Page(render_sweep(said, charts))


@pytest.mark.claim("sweep-page-stands-alone")
def test_page_needs_nothing_but_itself(page):
    assert all(address.startswith(("#", "data:")) for _, address in page.addresses())
    assert not {tag for tag, _ in page.tags} & {"iframe", "object", "embed"}
    assert "url(http" not in page.source


@pytest.mark.claim("sweep-page-stands-alone")
def test_page_keeps_the_pictures_of_the_worst(said, charts, monkeypatch):
    monkeypatch.setattr("airlight.reports.sweep.page.PICTURES", len(said.worst))
    shown = Page(render_sweep(said, charts))
    assert re.search(r"\d+ pictures are left out to keep the page small", shown.text)
    # The worst scene of every configuration keeps its picture.
    kept = {attributes["alt"].split(":")[1] for attributes in shown.attributes("img")}
    assert kept == {several[0].scene.split(":")[1] for several in said.worst.values()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "several",
    [
        [row("hall")],
        [row(f"random:{n}", status="refused", reason="no") for n in range(30)],
        [row(relative_rmse=None, rmse=None, nonfinite=19200)],
        [
            row(f"random:{n}", property_optical_depth=float(n), relative_rmse=0.0, rmse=0.0)
            for n in range(30)
        ],
    ],
    ids=["one", "all-refused", "no-number", "all-exact"],
)
def test_sweeps_at_the_edges_have_their_page(tmp_path, several):
    said = said_of(tmp_path, several)
    text = Page(
        render_sweep(said, {name: svg_text(figure, name) for name, figure in drawn_figures(said)})
    ).text
    assert "None" not in text
    assert "nan" not in re.findall(r"\b\w+\b", text)
    assert "inf" not in re.findall(r"\b\w+\b", text)
    assert (
        json.loads(json.dumps(plain(said), allow_nan=False))["rows"] == said.scenes == len(several)
    )


def test_names_and_reasons_are_words_and_never_html(tmp_path):
    evil = "</script><script>alert('1')</script> & \"q\" $x^2$ {{ 7 * 7 }}"
    several = [
        row(f"random:{n}", method=evil, property_depth=float(n), relative_rmse=0.1 * n)
        for n in range(1, 15)
    ]
    several.append(row("random:15", method="min-max", status="refused", reason=evil, command=evil))
    made = said_of(tmp_path, several)
    figures = {name: svg_text(figure, name) for name, figure in islice(drawn_figures(made), 1)}
    page = Page(render_sweep(made, figures))
    assert not page.scripts
    assert page.text.count("alert('N')") == 1
    assert page.text.count("alert('1')") > 10


@pytest.mark.slow
@pytest.mark.claim("sweep-from-parquet")
def test_all_is_written_from_the_parquet(tmp_path):
    source = tmp_path / "in"
    source.mkdir()
    write_rows(source / FILE, faulty_rows())
    _, page = write_sweep(source, tmp_path / "out")
    assert page == tmp_path / "out" / "sweep.html"
    written = {
        path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.*")
    }
    figures = {
        f"figures/{name}.{suffix}"
        for name in ("sweep-errors", "sweep-medians")
        for suffix in ("pdf", "svg")
    }
    assert written == {"sweep.html", "sweep.json", *figures}
    assert [path.name for path in source.iterdir()] == [FILE]


def test_a_figure_for_which_the_rows_have_no_data_any_more_is_gone(tmp_path, monkeypatch):
    monkeypatch.setattr("airlight.reports.sweep.page.drawn_figures", lambda said: iter(()))
    write_rows(tmp_path / FILE, rows(12))
    (tmp_path / "figures").mkdir()
    for name in ("sweep-medians.pdf", "sweep-medians.svg", "mine.pdf"):
        (tmp_path / "figures" / name).write_bytes(b"older")
    write_sweep(tmp_path)
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["mine.pdf"]


def test_the_command_writes_beside_the_rows_and_prints_what_it_writes(
    tmp_path, monkeypatch, capsys
):
    # they take long
    monkeypatch.setattr("airlight.reports.sweep.page.drawn_figures", lambda said: iter(()))
    write_rows(tmp_path / FILE, rows(30))
    assert run(["sweep", "--from", str(tmp_path)]) == 0
    assert METHODS[0][0] in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {FILE, "sweep.html", "sweep.json"}
    assert (
        run(["sweep", "--from", str(tmp_path / FILE), "--json", "-o", str(tmp_path / "said")]) == 0
    )
    data = json.loads(capsys.readouterr().out)["result"]
    assert len(data["claims"]) == 3 * len(METHODS)
    assert data == json.loads((tmp_path / "said" / "sweep.json").read_text())
