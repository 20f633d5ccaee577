# SPDX-License-Identifier: BSD-3-Clause
"""Every snippet of the README runs, and what the documents name exists."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
DOCUMENTS = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
}


def snippets(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)


def test_every_snippet_is_of_a_kind_that_is_run():
    assert set(re.findall(r"^```(\w+)$", README, flags=re.MULTILINE)) == {"sh", "python", "xml"}


def run(arguments, folder):
    command = [sys.executable, str(ROOT / "airlight.py"), *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)


@pytest.mark.claim("snippet-of-the-readme")
@pytest.mark.parametrize("code", snippets("python"))
def test_python_snippets(code, tmp_path):
    assert len(code.strip().splitlines()) <= 11
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300, check=True
    )
    printed = re.fullmatch(r"relative RMSE (\S+), (\S+) ms a frame\n", result.stdout)
    assert printed, result.stdout
    error, milliseconds = printed.groups()
    assert 0 < float(error) < 0.02  # 64 equi-angular steps against shadow edges
    assert float(milliseconds) > 0


def test_ci_runs_the_two_commands():
    """`./airlight report --quick` and `./airlight test` are too long for a test; CI runs them."""
    lines = [line for line in (ROOT / ".ci/run").read_text().splitlines() if line.startswith("./airlight")]
    assert lines == ["./airlight test", "./airlight report --quick"]
    assert snippets("sh")[0].splitlines() == ["./airlight report --quick", "./airlight test"]


@pytest.mark.claim("own-scene")
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
    for name in shown_commands():
        assert re.search(rf"\b{name}\b", table), name
        assert re.search(rf"\b{name}\b", helped), name


@pytest.mark.claim("single-scatter-agrees", "volpath-agrees", "costs-printed-by-bench")
def test_the_table_of_costs_was_printed_by_bench():
    """Dated, and no number written by hand: a table for each of its scenes, and every check of the truth agrees."""
    from reports.tables.drawing import markdown
    from reports.tables.methods import methods_table
    from validation.scenes.registry import SCENES

    table = README.split("<!-- bench: begin -->")[1].split("<!-- bench: end -->")[0]
    assert re.match(r"\n\d{4}-\d\d-\d\d, .*threads, (llvm|cuda)_ad_rgb\.\n", table)
    scenes = re.findall(r"^\*\*(\S+), 800 x 600\*\*$", table, flags=re.MULTILINE)
    assert {"open-fog", "sphere-spot", "two-pens"} <= set(scenes) <= set(SCENES)
    headings = markdown(methods_table("", [])).splitlines()[0]
    assert table.count(headings) == len(scenes) == len(set(scenes))
    verdicts = re.findall(r"^\| \S+, (airlight|surface) .*\| (\w+) \|$", table, flags=re.MULTILINE)
    assert [layer for layer, _ in verdicts].count("airlight") >= len(scenes)  # one for each estimator
    assert {verdict for _, verdict in verdicts} == {"yes"}


def commands() -> dict:
    """Return by name the options of every command."""
    import typer

    from reports.commands.main import app

    commands = typer.main.get_group(app).commands
    return {
        name: {option for parameter in command.params for option in [*parameter.opts, *parameter.secondary_opts]}
        for name, command in commands.items()
    }


def shown_commands() -> list[str]:
    """Return the names of the commands that --help shows."""
    import typer

    from reports.commands.main import app

    return [name for name, command in typer.main.get_group(app).commands.items() if not command.hidden]


def named_commands(text: str) -> list[tuple[str, list[str]]]:
    """Return the commands of a document with their options: in code, where it begins with `airlight`."""
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    lines = [line for block in blocks for line in block.splitlines()]
    lines += re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))
    lines += re.findall(r"^ {4}(airlight .*(?:\n {8,}[-\[].*)*)", text, flags=re.MULTILINE)
    matches = [re.match(r"(?:\./)?airlight\s+([a-z]+)\b(.*)", line, flags=re.DOTALL) for line in lines]
    return [(match[1], re.findall(r"(?<!\w)--?[a-z][a-z-]*", match[2])) for match in matches if match]


@pytest.mark.claim("documented-commands")
@pytest.mark.parametrize("name", DOCUMENTS)
def test_commands_and_options_that_documents_name_exist(name):
    known = commands()
    for command, options in named_commands(DOCUMENTS[name]):
        assert command in known, command
        given = {option for option in options if not (command == "test" and option == "-k")}
        assert given <= known[command] | {"--help"}, (command, given - known[command])


def test_commands_are_found_in_documents():
    """The test above is about something: commands are read from tables, blocks of code and sentences."""
    text = (
        "`airlight bench --no-such [A\\|B]`\n```sh\n./airlight merge a.exr -o b.exr\n```\n    airlight doctor  what\n"
    )
    assert named_commands(text) == [("merge", ["-o"]), ("bench", ["--no-such"]), ("doctor", [])]
    assert len(named_commands(README)) > 20
    assert "--target-error" in dict(named_commands(README))["reference"]


@pytest.mark.parametrize("name", DOCUMENTS)
def test_links_lead_somewhere(name):
    for target in re.findall(r"\]\(([^)\s]+)\)", DOCUMENTS[name]):
        if not re.match(r"https?:", target):
            path, _, anchor = target.partition("#")
            linked = (ROOT / name).parent / path
            assert linked.is_file() or not name.startswith("docs/"), target  # Sphinx finds no folder
            headings = re.findall(r"^#+ (.*)", linked.read_text(encoding="utf-8"), flags=re.MULTILINE) if anchor else []
            assert not anchor or anchor in [
                re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings
            ]


@pytest.mark.claim("margins", tolerance="none: equal")
def test_margins_are_those_of_the_efforts():
    from validation.frames.scene_study import EFFORTS

    columns = ("quick", "default", "full")
    table = DOCUMENTS["docs/ground-truth.md"].split("## How to read an agreement")[1]
    rows = re.findall(r"^\| `(single-scatter|volpath)` \| (.*) \|$", table, flags=re.MULTILINE)
    assert {name for name, _ in rows} == set(EFFORTS["default"].margins)
    for name, cells in rows:
        stated = [float(cell) / 100 for cell in re.findall(r"±([\d.]+) %", cells)]
        assert stated == pytest.approx([EFFORTS[effort].margins[name] for effort in columns], rel=1e-12), name


@pytest.mark.claim("cast-shadows", "shadow-ray-certificate")
def test_rays_of_the_truth_are_sampled_and_checked_as_often_as_stated(variant):
    import inspect

    from reference.quadrature.image import quadrature_image
    from reference.scene.read import read_truth
    from validation.scenes.loading import load_scene

    assert inspect.signature(quadrature_image).parameters["samples"].default == 256
    image = quadrature_image(read_truth(load_scene("sphere-spot", (8, 6)).scene))
    assert image.checked > 0
    assert image.checked % 32 == 0  # for each camera ray that looks into the light


def test_scenes_and_names_of_the_api_are_those_of_the_program():
    import airlight
    from validation.scenes.registry import SCENES

    for name in SCENES:
        assert f"`{name}`" in DOCUMENTS["CHANGELOG.md"], name
    said = README.split("A truth by samples is")[1].split("\n\n")[0]
    for name in re.findall(r"\b([a-z]+_[a-z_]+|Budget)\b", said):
        assert name in airlight.__all__, name


def test_a_reference_by_samples_from_python(variant):
    """What the README names in a sentence, put together."""
    import numpy as np

    import airlight

    loaded = airlight.load_scene("open-fog", size=(16, 12))
    parts = []
    for seed in (0, 500):
        budget = airlight.Budget(samples=64)
        parts.append(airlight.monte_carlo_reference(loaded, "single-scatter", budget=budget, seed=seed).image)
    files = [(f"{number}.exr", part) for number, part in enumerate(parts)]
    merged = airlight.merged_references(files).layers["airlight"]
    # Both have as many batches: the mean of all is the mean of the two.
    np.testing.assert_allclose(merged, np.mean([part.layers["airlight"] for part in parts], axis=0), rtol=1e-6)
