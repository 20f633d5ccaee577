# SPDX-License-Identifier: BSD-3-Clause
"""Integrals, benches and reports from Python, and the tutorial."""

import doctest
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import airlight
from analytic.cases import read_cases
from reports.api import studies as api_studies
from tests.helpers.api import FUNCTIONS, ROOT, TINY, brighter, third


def test_examples_of_the_docstrings(variant):
    outcome = doctest.testmod(api_studies)
    assert outcome.attempted
    assert not outcome.failed


def test_integrals_of_a_file_and_of_its_columns(data_folder, variant):
    path = data_folder / "airlight_integral.csv"
    integrals = airlight.integrate(path)
    assert integrals.summary["max"] < 4e-6  # the README's figure for the kernel `exact`
    assert integrals.J.shape == (2004,)
    cases = read_cases(path)
    columns = {name: getattr(cases, name) for name in ("phase", "g", "foot", "height", "x0", "x1", "sigma_t", "value")}
    again = airlight.integrate(columns)
    np.testing.assert_array_equal(again.J, integrals.J)
    np.testing.assert_array_equal(airlight.integrate(integrals.to_dict()).J, integrals.J)
    assert np.nanmax(np.abs(again.error)) == pytest.approx(integrals.summary["max"])
    assert "and 1992 more" in integrals._repr_html_()
    assert not integrals.J.flags.writeable


def test_integrals_have_the_shape_of_the_columns_and_a_certified_value(variant):
    foot, height = np.linspace(-1, 2, 5)[:, None], np.array([0.1, 0.7, 2.0])
    rays = {"phase": "hg", "g": 0.4, "foot": foot, "height": height, "x0": 0.0, "x1": np.inf, "sigma_t": 0.3}
    integrals = airlight.integrate(rays, "quadrature-32", precision="double", certify=True)
    assert integrals.J.shape == integrals.value.shape == integrals.error.shape == (5, 3)
    assert np.abs(integrals.error).max() < 1e-4
    assert np.asarray(integrals).shape == (5, 3)
    # By a kernel of one's own.
    own = airlight.integrate(rays, third, precision="double")
    assert own.kernel.endswith(":third")
    np.testing.assert_allclose(own.J, airlight.integrate(rays, precision="double").J / 3, rtol=1e-14)
    # One of them alone.
    alone = airlight.integrate(rays | {"foot": foot[3, 0], "height": 0.7}, "quadrature-32", precision="double")
    assert alone.J.shape == ()
    assert float(alone.J) == integrals.J[3, 1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sigma_t": -1.0}, "column 'sigma_t': -1.0 is out of range"),
        ({"foot": [1.0, 2.0], "height": [1.0, 2.0, 3.0]}, "shapes that do not go together"),
        ({"phase": "hgg"}, "did you mean 'hg'"),
    ],
)
def test_what_is_no_case_is_refused(change, words, variant):
    rays = {"phase": "isotropic", "foot": 0.5, "height": 0.3, "x0": 0.0, "x1": 1.0, "sigma_t": 0.3}
    assert airlight.integrate(rays).J > 0
    with pytest.raises(airlight.InputError, match=words):
        airlight.integrate(rays | change)
    with pytest.raises(airlight.InputError, match=f"no column '{next(iter(change))}'"):
        airlight.integrate({name: value for name, value in rays.items() if name not in change})


def test_bench_measures_names_functions_and_configurations(variant):
    told = []
    table = airlight.bench(
        airlight.load_scene("open-fog", TINY),
        [airlight.configuration("unshadowed", "taylor"), brighter],
        seconds=0.01,
        progress=lambda share, what: told.append(share),
    )
    taylor, own = table
    assert taylor["label"] == "unshadowed (taylor)"
    truth = airlight.reference("open-fog", size=TINY).airlight
    # Twice as bright: the error is the truth.
    assert own["relative_rmse"] == pytest.approx(np.sqrt(np.mean(truth**2)) / truth.mean(), rel=1e-5)
    assert own["relative_bias"] == pytest.approx(1.0, rel=1e-5)
    for row in table:
        assert row["scene"] == "open-fog"
        assert 0 < row["frame_low_ms"] <= row["frame_ms"] <= row["frame_high_ms"]
        assert row["refused"] is row["flip"] is None
        assert row["nonfinite"] == row["negative"] == 0
    columns = table.to_dict()
    assert set(map(len, columns.values())) == {2}
    assert columns["kernel"] == ["taylor", "exact"]
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert "unshadowed (taylor)" in table._repr_html_()


def test_report_hands_on_what_it_was_given(variant, tmp_path, monkeypatch):
    given = {}

    def write(folder, study, **options):
        given.update(options, folder=folder, study=study)
        return {"claims": [{"text": "so"}], "scenes": [], "created": ""}

    monkeypatch.setattr("reports.report.measure.write_report", write)
    report = airlight.report(tmp_path / "out", scenes=["open-fog"], methods=["min-max", brighter])
    assert report.folder == tmp_path / "out"
    assert report.claims == ("so",)
    assert (given["study"].scenes, given["study"].name) == (("open-fog",), "default")
    names = [configuration.method.rpartition(":")[2] for configuration in given["study"].configurations]
    assert names == ["min-max", "brighter"]
    with pytest.raises(airlight.InputError, match="did you mean 'full'"):
        airlight.report(tmp_path, effort="ful")
    with pytest.raises(airlight.InputError, match="did you mean 'hall'"):
        airlight.report(tmp_path, scenes=["hal"])


@pytest.mark.claim("report-defaults")
def test_a_report_without_options_is_the_commands(variant, tmp_path, monkeypatch):
    from reports.commands.main import run

    given = []

    def write(folder, study, **options):
        given.append({name: options[name] for name in ("images", "fresh")} | {"study": study})
        claims = [{"text": "so"}]
        return {"claims": claims, "scenes": [], "created": "", "seconds": 1, "kept": 0, "computed": 1, "measured": None}

    monkeypatch.setattr("reports.report.measure.write_report", write)
    monkeypatch.setattr("reports.report.asked.notes_on", lambda scenes: [])  # it loads every scene
    airlight.report(tmp_path / "python")
    assert run(["report", "-o", str(tmp_path / "command")]) == 0
    assert given[0] == given[1]


@pytest.mark.slow
@pytest.mark.claim("python-tutorial")
def test_the_tutorial_runs(tmp_path):
    """Every snippet of docs/python.md, one after the other as in a notebook, prints what the page says."""
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8").partition("## In a notebook")[0]
    blocks = re.findall(r"^```python\n(.*?)^```(?:\n\n```text\n(.*?)^```)?", page, flags=re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 8
    assert {name for name in FUNCTIONS if any(f"airlight.{name}(" in code for code, _ in blocks)} == set(FUNCTIONS)
    mark = "print('-- end of snippet --')\n"
    program = "".join(code + mark for code, _ in blocks if "airlight.report(" not in code)  # which takes minutes
    (tmp_path / "tutorial.py").write_text(program)
    ran = subprocess.run(
        [sys.executable, "tutorial.py"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert ran.returncode == 0, ran.stderr
    printed = ran.stdout.split("-- end of snippet --\n")
    expected = [text for code, text in blocks if "airlight.report(" not in code]
    for said, printed_now in zip(expected, printed):
        words, numbers = _parts(said)
        assert _parts(printed_now)[0] == words
        # Nothing here depends on the machine but rounding, and what samples and kernels make of it.
        np.testing.assert_allclose(_parts(printed_now)[1], numbers, rtol=0.5, atol=2e-3)


def _parts(text):
    """Return a text without its numbers, and these."""
    pattern = r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?"
    return re.sub(pattern, "#", text), [float(digits) for digits in re.findall(pattern, text)]
