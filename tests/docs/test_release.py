# SPDX-License-Identifier: BSD-3-Clause
"""Claims: the stamp, the changelog and the citation say one thing; a release is refused
where it would say too much.

A toy repository stands for that of airlight; the tool is `docs/tools/release.py`.
"""

import importlib
import json
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from airlight.reference.storage.build import COMMIT, build_of
from tests.helpers.git import WORLD, commit, git, write

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ROOT / "docs/tools"
sys.path.insert(0, str(TOOLS))
tool = importlib.import_module("release")
sys.path.remove(str(TOOLS))

BASELINE = "tests/evidence/baselines/street.json"
REPORT = "docs/data/replicate.json"
FILES = {
    tool.STAMP: '__version__ = "0.9.0.dev0"  # until it is released\n',
    f"src/airlight/{COMMIT}": "$Format:%H$\n",
    "src/airlight/py.typed": "",
    tool.CHANGELOG: (
        "# Changelog\n\n## [Unreleased]\n\n- `ray-march` is faster.\n\n## Before\n\n- It began.\n"
    ),
    tool.CITATION: "title: airlight\nversion: 0.9.0.dev0\nlicense: BSD-3-Clause\n",
    "LICENSE": "BSD-3-Clause\n",
    "README.md": "airlight\n",
    ".gitignore": "dist/\nbuild/\n*.egg-info/\n",
    "docs/formats.md": "# Formats\n",
    "analytic/panels.py": "NODES = 21\n",
    "validation/certified/rays.csv": "t,value\n1,0.5\n2,0.25\n",
}


@pytest.fixture(autouse=True)
def _tester(monkeypatch):
    """Nobody's settings of git, and a name for the commits of the tool."""
    for name in WORLD:
        if name.startswith("GIT_"):
            monkeypatch.setenv(name, WORLD[name])


def baseline(rmse: float) -> str:
    errors = {"relative_rmse": rmse, "mean": 0.3}
    return json.dumps(
        {"because": "x", "configurations": {"light-volumes (exact)": {"airlight": errors}}}
    )


def report(rmse: float, frame_ms: float) -> str:
    row = {
        "label": "soft-shafts (exact)",
        "error": {"relative_rmse": rmse},
        "times": {"frame": {"mean": frame_ms}},
    }
    return json.dumps({"scenes": [{"name": "hall", "methods": [row]}]})


def recorded(root: Path, **changes: object) -> None:
    """Write and commit the record of a run of all tests of the current commit."""
    run = {
        "commit": git(root, "rev-parse", "HEAD"),
        "changed": False,
        "compilation": "full",
        "passed": 9,
        "failed": 0,
    }
    write(root, {tool.RECORD: json.dumps(run | changes)})
    commit(root, "the record of all tests")


@pytest.fixture
def ready(tmp_path):
    """A checkout that may be released."""
    root = tmp_path / "checkout"
    write(root, FILES | {BASELINE: baseline(1e-4), REPORT: report(1e-3, 5.0)})
    commit(root, "all code")
    recorded(root)
    return root


def said(root: Path) -> str:
    return "\n".join(tool.problems(root))


@pytest.mark.claim("version-stamp")
def test_the_stamp_of_this_checkout_agrees_with_its_changelog_its_citation_and_its_tags():
    assert list(tool.stamp_problems(ROOT)) == []


@pytest.mark.claim("version-stamp")
@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        (tool.STAMP, '__version__ = "0.9.0"\n', r"expected \.dev0 behind it or \[0\.9\.0\]"),
        (
            tool.CHANGELOG,
            "## [Unreleased]\n\n- Fog.\n\n## [0.9.0] - 2026-11-27\n\n- Fog.\n",
            "that number was released",
        ),
        (tool.CITATION, "version: 1.0.0\n", r"version 1\.0\.0, expected 0\.9\.0\.dev0"),
    ],
)
def test_a_stamp_that_says_something_else_is_refused(ready, name, text, words):
    assert list(tool.stamp_problems(ready)) == []
    write(ready, {name: text})
    with pytest.raises(tool.RefusedError, match=words):
        raise tool.RefusedError("\n".join(tool.stamp_problems(ready)))


@pytest.mark.claim("release-refuses")
def test_changed_files_and_an_empty_changelog_are_refused(ready):
    assert said(ready) == ""
    write(ready, {"notes.txt": "mine"})
    assert "1 files are not as they were committed, such as notes.txt" in said(ready)
    write(ready, {tool.CHANGELOG: "# Changelog\n\n## [Unreleased]\n\n## Before\n\n- It began.\n"})
    commit(ready, "nothing new")
    assert said(ready) == "CHANGELOG.md has nothing in [Unreleased]: there is nothing to release"


@pytest.mark.claim("release-refuses")
@pytest.mark.parametrize(
    ("run", "words"),
    [
        ({"failed": 2}, "2 tests failed, 9 passed"),
        ({"passed": 0}, "0 tests failed, 0 passed"),
        ({"compilation": "quick"}, "expected full"),
        ({"changed": True}, "not known to be of the files of its commit"),
        ({"changed": None}, "not known to be of the files of its commit"),
        ({"commit": "1a2b3c4d"}, "is not in this repository"),
        ({"failed": "none"}, "is no record"),
    ],
)
def test_a_run_of_all_tests_that_is_red_or_of_other_files_is_refused(ready, run, words):
    recorded(ready, **run)
    assert words in said(ready)
    assert len(said(ready).splitlines()) == 1


@pytest.mark.claim("release-refuses")
def test_a_run_is_old_when_code_changed_since_and_not_when_a_page_did(ready):
    write(ready, {"README.md": "airlight, a page\n"})
    commit(ready, "a page")
    assert said(ready) == ""
    write(ready, {"analytic/panels.py": "NODES = 15\n"})
    commit(ready, "code")
    assert "is old: 1 files of code changed" in said(ready)
    assert "such as analytic/panels.py" in said(ready)
    recorded(ready)
    assert said(ready) == ""


@pytest.mark.claim("release-refuses")
def test_an_error_that_moved_since_the_last_release_needs_an_entry_that_names_it(ready):
    write(ready, {BASELINE: baseline(3e-4), REPORT: report(2e-3, 5.0)})
    commit(ready, "before the first release nobody had these numbers")
    recorded(ready)
    assert said(ready) == ""
    git(ready, "tag", "v0.8.0")
    # within the band; a time of another hour
    write(ready, {BASELINE: baseline(3.01e-4), REPORT: report(2e-3, 9.0)})
    commit(ready, "noise")
    recorded(ready)
    assert said(ready) == ""
    write(ready, {BASELINE: baseline(6e-4), REPORT: report(4e-3, 9.0)})
    write(ready, {"validation/certified/rays.csv": "t,value\n1,0.5\n2,0.26\n3,0.1\n"})
    commit(ready, "moved")
    recorded(ready)
    assert "errors of light-volumes (exact) moved since v0.8.0 in street" in said(ready)
    assert "errors of soft-shafts (exact) moved since v0.8.0 in hall" in said(ready)
    assert "values of rays.csv moved since v0.8.0" in said(ready)
    entries = "- `street` has twice the error of light volumes, `soft-shafts` too; `rays.csv` has a digit more.\n"
    write(ready, {tool.CHANGELOG: f"# Changelog\n\n## [Unreleased]\n\n{entries}"})
    commit(ready, "said")
    assert said(ready) == ""


@pytest.mark.claim("release-refuses")
def test_a_shallow_clone_is_refused(ready, tmp_path):
    git(tmp_path, "clone", "--quiet", "--depth=1", ready.as_uri(), "shallow")
    with pytest.raises(tool.RefusedError, match="shallow"):
        said(tmp_path / "shallow")


@pytest.fixture
def distributions(monkeypatch):
    """Archives in place of those that setuptools builds, which takes seconds;
    a test below builds them.
    """

    def written(tree, files):
        (files / "airlight.whl").write_text(
            (tree / tool.STAMP).read_text() + build_of(tree / "src/airlight", "").commit
        )

    monkeypatch.setattr(tool, "_distributions", written)


@pytest.mark.claim("release-refuses")
def test_a_release_is_a_commit_with_a_tag_and_files_of_nothing_else(ready, tmp_path, distributions):
    before = git(ready, "rev-parse", "HEAD")
    tool.release(ready, tmp_path / "dry", dry_run=True, site=False)
    assert (
        git(ready, "rev-parse", "HEAD"),
        git(ready, "tag"),
        git(ready, "status", "--porcelain"),
    ) == (before, "", "")
    names = {
        path.name: path
        for path in tool.release(ready, tmp_path / "dist", dry_run=False, site=False)
    }
    assert set(names) == {
        "SHA256SUMS",
        "airlight-0.9.0-certified.tar.gz",
        "airlight-0.9.0.md",
        "airlight.whl",
    }
    assert {path.name for path in (tmp_path / "dry/0.9.0").iterdir()} == set(names)
    # The files are of the tagged commit, in which stamp, changelog and citation say one thing.
    tagged = git(ready, "rev-parse", "v0.9.0^{commit}")
    assert names["airlight.whl"].read_text() == FILES[tool.STAMP].replace(".dev0", "") + tagged
    assert names["airlight-0.9.0.md"].read_text() == "- `ray-march` is faster.\n"
    assert "- `ray-march` is faster." in git(
        ready, "tag", "--list", "--format=%(contents)", "v0.9.0"
    )
    git(ready, "checkout", "--quiet", "v0.9.0")
    assert list(tool.stamp_problems(ready)) == []
    assert 'version: 0.9.0\ndate-released: "' in (ready / tool.CITATION).read_text()
    git(ready, "checkout", "--quiet", "main")
    # The next commit has the next stamp, and cites what was released.
    assert tool.stamped_number(ready) == ("0.9.1", True)
    assert list(tool.stamp_problems(ready)) == []
    assert "nothing to release" in said(ready)
    write(ready, {tool.STAMP: '__version__ = "0.9.0"\n', "analytic/panels.py": "NODES = 7\n"})
    assert "the tag v0.9.0 is of other code than this: the next stamp is due" in list(
        tool.stamp_problems(ready)
    )
    with tarfile.open(names["airlight-0.9.0-certified.tar.gz"]) as archive:
        held = {name.removeprefix("airlight-0.9.0-certified/") for name in archive.getnames()}
    assert held == {"CITATION.cff", "LICENSE", "formats.md", "rays.csv"}
    sums = names["SHA256SUMS"].read_text().splitlines()
    assert [line.split()[1] for line in sums] == sorted(set(names) - {"SHA256SUMS"})


@pytest.mark.slow
@pytest.mark.claim("build-named")
def test_wheel_and_source_distribution_of_airlight_name_its_commit_and_its_digest(tmp_path):
    """Also a wheel that is built from the source distribution, where there is no git."""
    if not (ROOT / ".git").exists():
        pytest.skip("this is no git checkout, so its commit is unknown")
    git(tmp_path, "clone", "--quiet", "--shared", str(ROOT), "clone")
    of = build_of(tmp_path / "clone/src/airlight", "")
    assert of.changed is False
    tool._distributions(tmp_path / "clone", tmp_path)
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        archive.extractall(tmp_path / "source", filter="data")
    (source,) = (tmp_path / "source").iterdir()
    assert build_of(source / "src/airlight", "") == of
    (tmp_path / "again").mkdir()
    tool._run(
        source, "the wheel", "-c", "import setuptools.build_meta as b; b.build_wheel('../../again')"
    )
    for wheel in (next(tmp_path.glob("*.whl")), next((tmp_path / "again").glob("*.whl"))):
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(wheel.with_suffix(""))
        assert build_of(wheel.with_suffix("") / "airlight", "") == of


@pytest.mark.claim("release-refuses")
def test_a_release_that_is_refused_or_fails_leaves_nothing(ready, tmp_path, monkeypatch):
    def broken(tree, files):
        raise tool.RefusedError("the wheel could not be made")

    before = git(ready, "rev-parse", "HEAD")
    monkeypatch.setattr(tool, "_distributions", broken)
    with pytest.raises(tool.RefusedError, match="could not be made"):
        tool.release(ready, tmp_path / "dist", dry_run=False, site=False)
    assert list((tmp_path / "dist").iterdir()) == []
    assert (
        git(ready, "rev-parse", "HEAD"),
        git(ready, "tag"),
        git(ready, "status", "--porcelain"),
    ) == (before, "", "")
    assert len(git(ready, "worktree", "list").splitlines()) == 1
