# SPDX-License-Identifier: BSD-3-Clause
"""Every command on every kind of scene: it ends as the table says, without a traceback,
and its text is its JSON.

The default tier has every command on four kinds; the slow tier has it on all, and each method
and estimator with each.
"""

import contextlib
import io
import json
import re
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from airlight.realtime.methods.registry import METHODS, PUBLISHED_METHODS
from airlight.reference.storage.exr import read_exr
from airlight.reports.commands.main import run
from airlight.reports.view.session import Session
from tests.helpers.kinds import HEIGHT, KINDS, WIDTH, write_kind

FOG = tuple(name for name in METHODS if not METHODS[name].renders_clouds)
CLOUDS = tuple(name for name in METHODS if METHODS[name].renders_clouds)
#: The methods that take turns: published ones share all but their sums with them,
#: and are of the slow tier.
TURNS = tuple(name for name in METHODS if name not in PUBLISHED_METHODS)
#: Methods that add up lit segments.
SUMS = (
    "unshadowed",
    "shadow-planes",
    "light-volumes",
    "min-max",
    "shadow-planes-2006",
    "light-volumes-2010",
)
ESTIMATORS = ("quadrature", "single-scatter", "volpath", "cloud-paths")

#: By kind, the methods and estimators that refuse it, with a word of why.
_OF_CLOUDS = dict.fromkeys((*CLOUDS, "cloud-paths"), "cloud")
REFUSED: dict[str, dict[str, str]] = {kind: _OF_CLOUDS for kind in KINDS}
REFUSED["density grid"] = _OF_CLOUDS | dict.fromkeys(SUMS, "grid")
for _kind in ("bounded media", "height fog, lamp", "height fog, sun", "sky"):
    REFUSED[_kind] = _OF_CLOUDS | {"light-volumes-2010": "homogeneous"}
REFUSED["cloud"] = dict.fromkeys(FOG, "sky")

#: The kinds of the default tier.
QUICK = ("no occluder", "occluders", "bounded media", "height fog, lamp")

#: A report of one scene: a quick look, as small as it can be.
STUDY = """scenes = ["{}"]
sizes = ["16x12"]
methods = ["{}"]
metrics = "usual"
times = "none"
points = 16
[checks]
size = "16x12"
margins = {{ single-scatter = 0.5 }}
samples = {{ single-scatter = 4 }}
batches = 16
multiple = [2, 1]
"""


@dataclass(frozen=True)
class Outcome:
    """The output of a command, and its status."""

    status: int
    out: str
    err: str


def typed(*words: object) -> Outcome:
    """Run the command line in this process; an exception of it is the test's."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = run([str(word) for word in words])
    return Outcome(status, out.getvalue(), err.getvalue())


def ended(status: int, *words: object) -> str:
    """Run a command that ends with a status; return what it printed."""
    outcome = typed(*words)
    assert outcome.status == status, (words, outcome.out[-500:], outcome.err[-500:])
    return outcome.out


def refused(why: str, *words: object) -> None:
    """Run a command that is refused, in one line that has a word of why."""
    outcome = typed(*words)
    last = outcome.err.strip().splitlines()[-1]
    assert (outcome.status, outcome.out) == (2, ""), words
    assert last.startswith("airlight: error: ")
    assert why in last, (words, last)


# Numbers of the text that the JSON has, too -------------------------------------------------------

_NUMBER = re.compile(r"(?<![\w.^])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
#: How the text may give a number of the JSON: as it is, in percent, in milliseconds.
_SCALES = (1.0, 100.0, 1000.0)


def numbers_of(data: object) -> list[float]:
    """Return all numbers of JSON data, those inside its words and the counts of its lists too."""
    if isinstance(data, bool) or data is None:
        return []
    if isinstance(data, int | float):
        return [float(data)]
    if isinstance(data, str):
        return [float(word) for word in _NUMBER.findall(data)]
    parts = list(data.values()) if isinstance(data, dict) else list(data)
    return [float(len(parts)), *(number for part in parts for number in numbers_of(part))]


def strays(text: str, data: object, folder: Path) -> list[str]:
    """Return the numbers of a text that are no rounded numbers of the JSON, paths left out."""
    known = np.array([scale * number for number in numbers_of(data) for scale in _SCALES])
    found = []
    for word in _NUMBER.findall(re.sub(rf"{re.escape(str(folder))}\S*", "", text)):
        digits = re.sub(r"^0+|\.", "", re.sub(r"e.*|-", "", word))
        # Half of the last digit that is printed.
        unit = 10.0 ** (
            -len(word.partition("e")[0].partition(".")[2]) + int(word.partition("e")[2] or 0)
        )
        if digits and not np.any(
            np.abs(known - float(word)) <= 0.501 * unit + 1e-12 * abs(float(word))
        ):
            found.append(word)
    return found


def same_numbers(
    folder: Path, *words: object, ignore: str = r"$^", status: int = 0
) -> tuple[str, dict]:
    """Run a command for its text and for its JSON; return both. Numbers in what matches
    `ignore` are the text's own.
    """
    text = ended(status, *words)
    data = json.loads(ended(status, *words, "--json"))["result"]
    assert strays(re.sub(ignore, "", text), data, folder) == [], (words, text)
    return text, data


# The cells ----------------------------------------------------------------------------------------


def look(path: Path, monkeypatch) -> None:
    """Open the view in this process until a page has been sent one frame."""
    frames = []

    def shown(session) -> None:
        page = SimpleNamespace(
            tell=lambda kind, **values: json.dumps(values, allow_nan=False),
            show=lambda picture, **values: frames.append(
                (np.frombuffer(picture, np.uint8), values)
            ),
            close=lambda why: None,
        )
        session.opened(page)
        for _ in range(20):
            if not frames:
                session.turn()

    monkeypatch.setattr(Session, "run", shown)
    size = f"{WIDTH}x{HEIGHT}"
    method = "cloud-octaves" if path.stem == "cloud" else "ray-march"
    assert ended(0, "view", path, "--method", method, "--size", size).startswith(
        "http://127.0.0.1:"
    )
    picture, values = frames[0]
    assert values["kind"] == "frame"
    assert len(np.unique(picture)) > 10


def described(path: Path) -> None:
    glb = path.with_suffix(".glb")
    text, data = same_numbers(path.parent, "describe", path, ignore=r"(?m)^pixels.*|column i.*")
    assert data["scene"] in text
    assert data["camera"]["size"] == [WIDTH, HEIGHT]
    triangles = json.loads(ended(0, "describe", path, "-o", glb, "--json"))["result"]["gltf"][
        "triangles"
    ]
    assert glb.read_bytes()[:4] == b"glTF"
    assert f"{triangles} triangles" in ended(0, "describe", path, "-o", glb)


def referenced(path: Path, estimator: str) -> Path:
    file = path.with_name(f"{estimator}.exr")
    samples = [] if estimator == "quadrature" else ["--samples", "8"]
    asked = ("reference", path, "--estimator", estimator, *samples, "-o", file)
    # A run that continues says so; and how well a standard error is known follows from the batches.
    ignore = r"\d+ of \d+ batches from the cache|is known to \d+ % only"
    text, data = same_numbers(path.parent, *asked, ignore=ignore)
    image = read_exr(file)
    assert set(data["means"]) == set(image.layers) - {"total"}
    for name, mean in data["means"].items():
        assert f"{name}: mean {', '.join(f'{value:.6g}' for value in mean)}" in text
        assert np.mean(image.layers[name], axis=(0, 1)) == pytest.approx(mean, rel=1e-5, abs=1e-9)
    return file


def rendered(path: Path, method: str) -> Path:
    file = path.with_name(f"{method}.exr")
    text, data = same_numbers(path.parent, "render", path, "--method", method, "-o", file)
    assert f"{data['scene']} by {data['label']}" in text
    assert data["method"] == method
    assert read_exr(file).layers["airlight"].shape == (HEIGHT, WIDTH, 3)
    return file


def compared(path: Path, reference: Path, frame: Path) -> None:
    ignore = r"(?<![\d.])(95 %|\d+ % power|\d+ % level)|over \d+ %|the worst \d+ %|known to \S+ of its mean"
    text, data = same_numbers(path.parent, "compare", reference, frame, ignore=ignore)
    assert f"relative {100 * data['metrics']['relative_rmse']:.4g} %" in text
    text, data = same_numbers(
        path.parent, "compare", path, frame, "--pixel", "centre", ignore=ignore
    )
    assert f"relative {100 * data['metrics']['relative_rmse']:.4g} %" in text
    known = data["known"]
    assert f"known to {known['error'] / known['value']:.2g} of its mean ({known['kind']})" in text


def reported(path: Path, method: str) -> None:
    study, folder = path.with_name("study.toml"), path.with_name("report")
    study.write_text(STUDY.format(path, method), encoding="utf-8")
    outcomes = [typed("report", study, "-o", folder, *more) for more in ([], ["--json"])]
    assert {outcome.status for outcome in outcomes} == {0}, outcomes[0]
    data = json.loads(outcomes[1].out)["result"]
    assert data == json.loads((folder / "report.json").read_text(encoding="utf-8"))
    for claim in data["claims"]:
        assert f"- {claim['text'].replace('`', '')}" in outcomes[0].out
    assert [row["method"] for row in data["scenes"][0]["methods"]] == [method]
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert data["scenes"][0]["name"] in page


def accepted(kind: str, names: tuple[str, ...]) -> list[str]:
    return [name for name in names if name not in REFUSED[kind]]


def chosen(kind: str) -> tuple[str, str, str]:
    """Return the estimator, the method to render and the one to report of a kind in the
    default tier: all by turns.
    """
    turn, estimators, methods = (
        list(KINDS).index(kind),
        accepted(kind, ESTIMATORS)[1:],
        accepted(kind, TURNS),
    )
    return (
        estimators[(turn + 2) % len(estimators)],
        methods[(turn + 1) % len(methods)],
        methods[turn % len(methods)],
    )


@pytest.mark.claim("every-command-on-every-kind")
@pytest.mark.parametrize(
    "kind", [pytest.param(each, marks=[] if each in QUICK else pytest.mark.slow) for each in KINDS]
)
def test_every_command_on_this_kind(variant, kind, tmp_path, monkeypatch):
    path = write_kind(kind, tmp_path)
    estimator, method, measured = chosen(kind)
    described(path)
    for name, why in REFUSED[kind].items():
        command = (
            ("reference", path, "--estimator")
            if name in ESTIMATORS
            else ("render", path, "--method")
        )
        refused(why, *command, name, "-o", path.with_name("refused.exr"))
    assert not path.with_name("refused.exr").exists()
    exact = referenced(path, "quadrature")
    referenced(path, estimator)
    compared(path, exact, rendered(path, method))
    reported(path, measured)
    look(path, monkeypatch)


def test_every_method_and_every_estimator_has_its_turn():
    estimators, *methods = zip(*map(chosen, KINDS))
    assert {*estimators, "quadrature"} == set(ESTIMATORS)
    assert {name for each in methods for name in each} == set(TURNS)


@pytest.mark.slow
@pytest.mark.claim("every-command-on-every-kind")
@pytest.mark.parametrize("kind", KINDS)
def test_every_method_and_estimator_on_this_kind(variant, kind, tmp_path):
    path = write_kind(kind, tmp_path)
    exact, *_ = [referenced(path, name) for name in accepted(kind, ESTIMATORS)]
    for name in accepted(kind, tuple(METHODS)):
        compared(path, exact, rendered(path, name))
    ended(0, "reference", path, "--pixel", "area", "-o", path.with_name("area.exr"))
