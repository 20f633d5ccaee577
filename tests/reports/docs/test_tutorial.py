# SPDX-License-Identifier: BSD-3-Clause
"""The tutorial runs as it stands, from its scene to its figures, in under three minutes of a processor."""

import re
import shlex
import time
from pathlib import Path

import pytest

from reports.commands.main import run

DOCS = Path(__file__).parents[3] / "docs"
TUTORIAL = (DOCS / "tutorial.md").read_text(encoding="utf-8")
NOTEBOOKS = (DOCS / "notebooks.md").read_text(encoding="utf-8")


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


@pytest.mark.claim("tutorial")
@pytest.mark.slow
def test_the_tutorial_ends_with_a_figure(variant, tmp_path, monkeypatch, capfd):
    """Every command of the page, in its order. Exit status 1 is a check of the truth that --quick had no time for.

    Processor time counts, of all threads, since other work on the machine must not fail a test.
    """
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gate.xml").write_text(blocks(TUTORIAL, "xml")[0], encoding="utf-8")
    start = time.process_time()
    lines = "".join(blocks(TUTORIAL, "sh")).splitlines()
    assert len(lines) == 8
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "airlight"
        status = run(words)
        assert status in ((0, 1) if words[0] == "report" else (0,)), (line, capfd.readouterr().err)
    assert time.process_time() - start < 180
    for name in ("gate.png", "truth.exr", "gate-report/report.html", "figures/strip.pdf", "narrow/strip.pdf"):
        assert (tmp_path / name).stat().st_size > 1000, name
    assert r"\begin{tabular}" in (tmp_path / "figures/methods-table.tex").read_text()
    printed = capfd.readouterr().out
    assert "lights: 1 point" in printed
    assert "8 rays a pixel" in printed
    # Several per cent with 32 steps, as the page says.
    (share,) = re.findall(r"^rmse .* relative ([\d.]+) %$", printed, flags=re.MULTILINE)
    assert 1 < float(share) < 10


@pytest.mark.claim("notebook-cells")
def test_the_cells_of_the_notebook_page_run_and_display(variant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    import matplotlib.pyplot as plt

    plt.switch_backend("agg")
    space: dict = {}
    displayed = []
    for cell in blocks(NOTEBOOKS, "python"):
        exec(compile(cell, "cell", "exec"), space)
        last = cell.strip().splitlines()[-1]
        if last.isidentifier():
            displayed.append(space[last]._repr_html_())
    assert len(displayed) == 2
    assert all("<img" in html for html in displayed)
    errors = space["errors"]
    assert errors[0] / errors[-1] > 4  # about one over the steps, from 8 to 64
    plt.close("all")
