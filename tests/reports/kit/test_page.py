# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the steps of `docs/conformance-kit.md` give what the page says, in an empty folder."""

import math
import re
import shutil
import subprocess
from pathlib import Path
from textwrap import dedent

import pytest

PAGE = Path(__file__).resolve().parents[3] / "docs" / "conformance-kit.md"


def test_the_steps_of_the_page(kit, tmp_path):
    if not shutil.which("cc"):
        pytest.skip("cc is not installed")
    (tmp_path / "kit").symlink_to(kit)
    steps = PAGE.read_text().partition("## Five steps")[2].partition("\n## ")[0]
    blocks = re.findall(r"^   ```(\w+)\n(.*?)^   ```$", steps, flags=re.DOTALL | re.MULTILINE)
    assert [kind for kind, _ in blocks] == ["sh", "c", "sh", "text", "sh", "text"]
    told = ""
    for kind, block in blocks:
        text = dedent(block)
        if kind == "c":
            (tmp_path / "fog_test.c").write_text(text)
        elif kind == "sh":
            ran = subprocess.run(["sh", "-c", text], cwd=tmp_path, capture_output=True, text=True)
            assert ran.stderr == ""
            told = ran.stdout
        else:
            lines = [line.split() for line in told.splitlines()]
            for line in text.splitlines():
                assert any(same(line.split(), each) for each in lines), line


def same(words, others):
    """Return whether lines have the same words, and numbers to four digits: compilers round."""
    return len(words) == len(others) and all(
        one == other or math.isclose(number(one), number(other), rel_tol=1e-4)
        for one, other in zip(words, others, strict=True)
    )


def number(word):
    return float(word.rstrip(",")) if re.fullmatch(r"[\d.e+-]+,?", word) else math.nan
