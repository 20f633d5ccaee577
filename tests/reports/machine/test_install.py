# SPDX-License-Identifier: BSD-3-Clause
"""Claim: packages are installed by uv, or by pip with the same checksums; the project
once for each declaration.

A uv and a Python that only say what they were asked stand for the real ones.
"""

import os
import sys
from pathlib import Path

import pytest

from airlight.reports.machine.install import install, requirements

ROOT = Path(__file__).resolve().parents[3]

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="the launcher is a script for POSIX shells"),
    pytest.mark.claim("launcher"),
]

# It logs its name, what it is to install, and how many lines of a list have checksums;
# `NAME-fails` makes it fail.
_PROGRAM = """#!/bin/sh
here=$(dirname "$0") name=$(basename "$0") what=project
for word; do case $word in *.txt) what=$(grep -c -- --hash=sha256: "$word") ;; esac; done
echo "$name $what" >>"$here/log"
[ ! -e "$here/$name-fails" ]
"""


@pytest.fixture
def environment(tmp_path, monkeypatch):
    """An environment with a Python, which has pip, and uv."""
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("python", "uv"):
        (programs / name).write_text(_PROGRAM)
        (programs / name).chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(programs / "python"))
    return tmp_path


def _log(environment: Path) -> list[str]:
    path = environment / "bin" / "log"
    lines = path.read_text().splitlines() if path.exists() else []
    path.unlink(missing_ok=True)
    return lines


def test_uv_installs_all_and_the_project_again_only_where_its_declaration_changed(
    environment, capfd
):
    base, sweep = len(requirements([])), len(requirements(["sweep"]))
    assert install([], ROOT, environment)
    assert _log(environment) == [f"uv {base}", "uv project"]
    assert install(["sweep"], ROOT, environment)
    assert _log(environment) == [f"uv {sweep}"]
    (environment / "airlight-pyproject.toml").write_text("other")
    assert install([], ROOT, environment)
    assert _log(environment) == [f"uv {base}", "uv project"]
    assert capfd.readouterr().err == ""


def test_pip_installs_the_same_files_where_uv_cannot(environment, capfd):
    base = len(requirements([]))
    (environment / "bin" / "uv-fails").touch()
    assert install([], ROOT, environment)
    assert _log(environment) == [f"uv {base}", f"python {base - 1}", "python project"]
    assert "pip installs the same versions" in capfd.readouterr().err
    (environment / "bin" / "uv").unlink()  # where uv cannot be had, and pip does not find it
    (environment / "airlight-pyproject.toml").unlink()
    assert install([], ROOT, environment)
    assert _log(environment) == ["python 1", f"python {base - 1}", "python project"]


def test_a_failure_is_one_and_leaves_the_project_to_be_installed(environment):
    for name in ("uv", "python"):
        (environment / "bin" / f"{name}-fails").touch()
    assert not install([], ROOT, environment)
    for name in ("uv", "python"):
        (environment / "bin" / f"{name}-fails").unlink()
    _log(environment)
    assert install([], ROOT, environment)
    assert "uv project" in _log(environment)


def test_an_extra_that_is_not_declared_is_refused():
    with pytest.raises(KeyError, match="nonsense"):
        requirements(["nonsense"])
