# SPDX-License-Identifier: BSD-3-Clause
"""Reports from Python, and the tutorial."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest

import airlight
from tests.helpers.api import FUNCTIONS, ROOT, brighter


def test_report_hands_on_what_it_was_given(variant, tmp_path, monkeypatch):
    given = {}

    def write(folder, study, **options):
        given.update(options, folder=folder, study=study)
        made = {"claims": [{"text": "so"}], "scenes": [], "created": "", "seconds": 1, "cached": 0, "computed": 1}
        return made | {"measured": None}

    monkeypatch.setattr("reports.report.measure.write_report", write)
    report = airlight.report("open-fog", method=["min-max", brighter], output=tmp_path / "out")
    assert report.folder == tmp_path / "out"
    assert report.claims == ("so",)
    assert given["study"].scenes == ("open-fog",)
    assert given["study"].name == "default"
    assert not given["apart"]  # a function runs here
    names = [configuration.method.rpartition(":")[2] for configuration in given["study"].configurations]
    assert names == ["min-max", "brighter"]


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
