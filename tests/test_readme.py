# SPDX-License-Identifier: BSD-3-Clause
"""Every snippet of the README runs."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def snippets(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)


def test_every_snippet_is_of_a_kind_that_is_run():
    assert set(re.findall(r"^```(\w+)$", README, flags=re.MULTILINE)) == {"sh", "python", "xml"}


def run(arguments, folder):
    command = [sys.executable, str(ROOT / "airlight.py"), *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)


@pytest.mark.parametrize("code", snippets("python"))
def test_python_snippets(code, tmp_path):
    assert len(code.strip().splitlines()) <= 11
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300, check=True
    )
    error, milliseconds = re.fullmatch(r"relative RMSE (\S+), (\S+) ms a frame\n", result.stdout).groups()
    assert 0 < float(error) < 0.02  # 64 equi-angular steps against shadow edges
    assert float(milliseconds) > 0


def test_ci_runs_the_two_commands():
    """`./airlight report` and `./airlight test` are too long for a test; CI runs them, the report with --quick."""
    lines = [line for line in (ROOT / ".ci/run").read_text().splitlines() if line.startswith("./airlight")]
    assert lines == ["./airlight test", "./airlight report --quick"]
    assert snippets("sh")[0].splitlines() == ["./airlight report", "./airlight test"]


@pytest.mark.slow
def test_scene_with_a_mesh_of_the_users_own(tmp_path):
    (tmp_path / "mesh.obj").write_text(
        "v -0.4 -0.4 0.1\nv 0.4 -0.4 0.1\nv 0.0 0.5 0.1\nv 0.0 0.0 0.9\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    )
    (tmp_path / "mesh-in-fog.xml").write_text(snippets("xml")[0])
    words = shlex.split(snippets("sh")[1])
    assert words[0] == "./airlight"
    result = run(words[1:], tmp_path)
    assert result.returncode == 0, result.stderr
    page = (tmp_path / "airlight-report" / "report.html").read_text(encoding="utf-8")
    assert "mesh-in-fog" in page


def test_commands_of_the_table_exist():
    helped = run(["--help"], ROOT).stdout
    table = README.split("| command | what it does |")[1].split("\n\n")[0]
    for name in ("report", "bench", "render", "reference", "compare", "integrate", "scenes", "doctor", "test"):
        assert name in table
        assert re.search(rf"\b{name}\b", helped), name


def test_the_table_of_costs_was_printed_by_bench():
    """Dated, with all four scenes, and no number written by hand: the rows have the form that `bench` prints."""
    from reports.bench_tables import _HEADERS

    table = README.split("<!-- bench: begin -->")[1].split("<!-- bench: end -->")[0]
    assert re.match(r"\n\d{4}-\d\d-\d\d, .*threads, (llvm|cuda)_ad_rgb\.\n", table)
    for scene in ("open-fog", "sphere-spot", "colonnade", "two-pens"):
        assert f"**{scene}, 800 x 600**" in table
    assert table.count("| " + " | ".join(_HEADERS) + " |") == 4
    assert table.count("| yes |") == 7  # airlight in four scenes, surface in three
