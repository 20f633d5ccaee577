# SPDX-License-Identifier: BSD-3-Clause
"""The view shows what the page asks for, mistakes are one line, and the command on the
page makes the same image.

The reference is computed by a stand-in in this process, and at once; one slow test has the process.
"""

import json
import shlex
import time

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.storage.exr import read_exr
from airlight.reports.commands import main as cli
from airlight.reports.view.reference import KnownReference, Task, answers
from airlight.reports.view.session import Session
from airlight.reports.view.widgets import ViewState
from airlight.validation.study.configuration import configuration
from tests.helpers.shaders import need_opengl

SIZE = (20, 15)
AIM = {"camera.origin": [0.61, -0.3, 0.4], "camera.target": [0.2, 0.1, 4.0], "camera.up": [0, 1, 0]}


class ReferenceAtOnce:
    """A stand-in for the process of the reference; `starts` counts what it was asked for."""

    def __init__(self, told, variant):
        self.told, self.known, self.done, self.failure, self.starts = told, None, False, "", 0

    def start(self, scene, size, changes, most=None):
        self.starts += most is None
        self.known, self.done = KnownReference.of_size(*size), False
        for answer in answers(Task(1, scene, size, dict(changes), most)):
            if answer.pixels is not None:
                self.known.add(answer.pixels, answer.airlight, answer.surface, answer.error)
            self.done = answer.done
        self.told()

    def stop(self):
        self.known, self.done = None, False

    def end(self):
        pass


class Page:
    """A page that keeps what it is told, as JSON holds it, and shows each frame at once."""

    def __init__(self, session):
        self.session, self.said, self.frames, self.others = session, [], [], []

    def tell(self, kind, **values):
        self.said.append(json.loads(json.dumps({"kind": kind} | values, allow_nan=False)))

    def show(self, picture, **values):
        json.dumps(values, allow_nan=False)
        kept = self.frames if values["kind"] == "frame" else self.others
        kept.append(
            values | {"picture": np.frombuffer(picture, np.uint8).reshape(SIZE[1], SIZE[0], 4)}
        )
        if values["kind"] == "frame":
            self.session.told(self, {"kind": "drawn", "frame": values["frame"]})

    def close(self, why):
        self.said.append({"kind": "closed", "message": why})

    def last(self, kind):
        return next(said for said in reversed(self.said) if said["kind"] == kind)


def turns(session, until, limit=300):
    stop = time.monotonic() + limit
    while not until():
        assert time.monotonic() < stop, "it did not happen in time"
        session.turn()


def opened(scene="sphere-spot", method="shadow-planes", **parameters):
    session = Session(ViewState(scene, SIZE, configuration(method, None, parameters)), mi.variant())
    page = Page(session)
    session.opened(page)
    turns(session, lambda: page.frames)
    return session, page


@pytest.fixture
def view(variant, monkeypatch):
    monkeypatch.setattr("airlight.reports.view.session.ReferenceInBackground", ReferenceAtOnce)
    return opened


def ask(session, page, **message):
    before = len(page.frames)
    session.told(page, message)
    turns(session, lambda: len(page.frames) > before and session._told >= session._changed_at)


@pytest.mark.claim("view-command", tolerance="bit by bit")
def test_the_commands_on_the_page_show_what_is_shown(view, tmp_path, monkeypatch):
    session, page = view()
    ask(session, page, kind="change", changes=AIM)
    ask(
        session,
        page,
        kind="change",
        changes={"light.position": [0.4, 0.3, 4.2], "medium.sigma_t": [0.29]},
    )
    ask(session, page, kind="choose", method="ray-march")
    ask(session, page, kind="choose", parameter="steps", value="23")
    ask(session, page, kind="choose", parameter="sum", value="transitions")
    ask(session, page, kind="choose", kernel="quadrature-12")
    ask(
        session,
        page,
        kind="change",
        changes={"camera.fov": [41.3], "medium.albedo": [0.7, 0.6, 0.5]},
    )
    commands = {
        name: shlex.split(command)[1:] for name, command in page.last("state")["commands"].items()
    }
    assert cli.run([*commands["render"], "-o", str(tmp_path / "same.exr")]) == 0
    written = read_exr(tmp_path / "same.exr").layers
    frame = session.live.on_host(session.live.frame())
    np.testing.assert_array_equal(written["airlight"], frame.airlight.astype(np.float32))
    np.testing.assert_array_equal(written["surface"], frame.surface.astype(np.float32))
    assert np.abs(page.frames[0]["picture"].astype(int) - page.frames[-1]["picture"]).max() > 0
    started = []
    monkeypatch.setattr(
        "airlight.reports.view.session.Session",
        lambda state, variant: started.append(state) or 1 / 0,
    )
    with pytest.raises(ZeroDivisionError):
        cli.run(commands["view"])
    assert started == [session._state()]
    assert cli.run([*commands["reference"], "-o", str(tmp_path / "reference.exr")]) == 0
    turns(session, lambda: session.reference.done and session._reference_of is not None)
    # float32 in the file
    np.testing.assert_allclose(
        session.reference.known.airlight,
        read_exr(tmp_path / "reference.exr").layers["airlight"],
        rtol=1e-6,
    )


@pytest.mark.claim("view-error", tolerance="1e-5 relative: EXR rounds to float32")
def test_the_error_is_that_of_compare_and_begins_again_when_the_scene_changes(
    view, tmp_path, capfd
):
    session, page = view("sphere-spot", "ray-march", steps=7)
    ask(session, page, kind="show", other="reference")
    turns(
        session,
        lambda: (
            page.others and any(said.get("done") for said in page.said if said["kind"] == "error")
        ),
    )
    error = page.last("error")["error"]
    assert error["known"] == error["pixels"] == SIZE[0] * SIZE[1]
    assert 0 < error["own_error"] < 1e-6
    commands = page.last("state")["commands"]
    method, reference = str(tmp_path / "method.exr"), str(tmp_path / "reference.exr")
    assert cli.run([*shlex.split(commands["render"])[1:], "-o", method]) == 0
    assert cli.run([*shlex.split(commands["reference"])[1:], "-o", reference]) == 0
    capfd.readouterr()
    assert cli.run(["compare", reference, method, "--json"]) == 0
    compared = json.loads(capfd.readouterr().out)["result"]["metrics"]
    assert error["relative_rmse"] == pytest.approx(compared["relative_rmse"], rel=1e-5)
    assert error["relative_bias"] == pytest.approx(compared["relative_bias"], rel=1e-4)
    # Another method has the same reference; another scene has not.
    ask(session, page, kind="choose", parameter="steps", value=21)
    turns(
        session, lambda: page.last("error")["error"]["relative_rmse"] < 0.5 * error["relative_rmse"]
    )
    assert session.reference.starts == 1
    ask(session, page, kind="change", changes={"medium.sigma_t": [0.5]})
    turns(session, lambda: session.reference.starts == 2)


def test_the_mean_of_noisy_frames_comes_nearer_to_the_reference_until_something_changes(view):
    session, page = view("open-fog", "equi-angular")
    turns(
        session,
        lambda: any(said.get("frames", 0) >= 32 for said in page.said if said["kind"] == "error"),
    )
    said = page.last("error")
    # Without a bias the error falls with the root of the frames: 5.7 times, of few
    # bright pixels less evenly.
    assert said["mean"] < 0.4 * said["error"]["relative_rmse"]
    session.told(page, {"kind": "choose", "parameter": "samples", "value": 2})
    session.turn()
    assert session.live.summed < 32
    ask(session, page, kind="choose", method="unshadowed")
    assert session.live.summed == 0


@pytest.mark.claim("view-error")
def test_no_error_is_told_of_a_frame_of_the_scene_before_a_change(view, monkeypatch):
    """A page that has two frames to show yet gets the frame of a change later."""
    for name in ("_QUIET", "_STILL", "_NEWS"):
        monkeypatch.setattr(f"airlight.reports.view.session.{name}", 0.0)
    session, page = view("open-fog", "unshadowed")
    turns(session, lambda: any(said["kind"] == "error" for said in page.said))
    session._sent += 2
    said, starts = len(page.said), session.reference.starts
    session.told(page, {"kind": "change", "changes": {"medium.sigma_t": [0.61]}})
    for _ in range(2):
        session._said.append((page, {}))  # the loop does not wait
        session.turn()
    assert session.reference.starts == starts
    assert "error" not in [each["kind"] for each in page.said[said:]]
    session.told(page, {"kind": "drawn", "frame": session._sent})
    turns(session, lambda: "error" in [each["kind"] for each in page.said[said:]])
    assert session.reference.starts > starts
    assert page.last("error")["error"]["relative_rmse"] < 1e-4


@pytest.mark.claim("view-error")
@pytest.mark.parametrize("method", ["ray-march", "ray-march+history"])
def test_frames_of_a_scene_that_changes_are_judged_as_they_were_shown(view, monkeypatch, method):
    """A history has the light of earlier frames: while a light moves it is further off than
    the same method at rest.
    """
    monkeypatch.setattr("airlight.reports.view.session._STILL", 1e9)
    session, page = view("open-fog", method, steps=64)
    for n in range(6):
        ask(session, page, kind="change", changes={"light.position": [0.83 - 0.3 * n, 0.47, 1.57]})
    moving = page.last("motion")
    assert moving["frames"] >= 5
    assert moving["pixels"] == 256
    monkeypatch.setattr("airlight.reports.view.session._STILL", 0.0)
    turns(
        session,
        lambda: (
            session._reference_of is not None
            and session.reference.done
            and session._wanted == 0
            and not session._news
        ),
        60,
    )
    still = page.last("error")["error"]["relative_rmse"]
    assert (moving["rmse"] > 10 * still) == ("history" in method)


@pytest.mark.parametrize(
    ("message", "says"),
    [
        ({"kind": "choose", "parameter": "points", "value": -1}, "points: got -1"),
        ({"kind": "choose", "method": "shadow-plains"}, "did you mean 'shadow-planes'?"),
        ({"kind": "change", "changes": {"medium.sigma": [1]}}, "did you mean 'medium.sigma_t'?"),
    ],
)
def test_a_mistake_is_one_line_and_changes_nothing(view, message, says):
    session, page = view("open-fog")
    state = session._state()
    session.told(page, message)
    turns(session, lambda: any(said["kind"] == "mistake" and said["message"] for said in page.said))
    told = page.last("mistake")["message"]
    assert says in told
    assert "\n" not in told
    assert session._state() == state


def test_no_message_ends_the_view(view):
    session, page = view("open-fog", "unshadowed")
    for message in (
        {},
        {"kind": "nonsense"},
        {"kind": "change", "changes": {"a": "b", "c": [None]}},
        {"kind": "show", "layer": "no such", "exposure": "bright"},
        {"kind": "choose", "method": {}},
        {"kind": "choose", "parameter": "points", "value": [1]},
        {"kind": "drawn", "frame": 10**400},
        {"kind": "change", "changes": {"medium.sigma_t": [10**400]}, "moves": -(10**400)},
    ):
        session.told(page, message)
        session.turn()
    ask(session, page, kind="change", changes={"medium.sigma_t": [0.3]})
    assert session.live.changes == {"medium.sigma_t": (0.3,)}


@pytest.mark.claim("view-token")
def test_a_page_chooses_no_code_to_run(view, tmp_path, monkeypatch):
    """Who knows the token may choose what is built in and what the user
    named, and not import a file.
    """
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.py").write_text(
        "open('ran', 'w')\ndef fog(view, *, kernel=None):\n    return 1.0\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    session, page = view("open-fog", "unshadowed")
    for choice in (
        {"method": "evil:fog"},
        {"method": str(tmp_path / "evil.py:fog")},
        {"kernel": "evil:fog"},
    ):
        session.told(page, {"kind": "choose"} | choice)
        page.said.clear()
        turns(
            session,
            lambda: any(said["kind"] == "mistake" and said["message"] for said in page.said),
        )
        assert not (tmp_path / "ran").exists()
    assert session._state().chosen == configuration("unshadowed")


def test_a_shader_is_read_again_when_its_file_changes_and_a_mistake_leaves_the_picture(
    view, tmp_path
):
    need_opengl()
    shader = tmp_path / "fog.glsl"
    text = "#pragma airlight set GAIN 2.0\nvec3 airlight(Ray ray) { return vec3(GAIN * 0.1 * BRIGHT); }\n"
    shader.write_text(text.replace("BRIGHT", "1.0"))
    session, page = opened(method=str(shader), GAIN=3.0)

    def write(bright):
        page.said.clear()
        drawn = len(page.frames)
        shader.write_text(text.replace("BRIGHT", bright))
        turns(
            session,
            lambda: (
                any(said["kind"] == "mistake" for said in page.said) and len(page.frames) > drawn
            ),
            60,
        )
        return page.last("mistake")["message"], session.live.on_host(session._shown).airlight[
            0, 0, 0
        ]

    assert write("nowhere") == (
        f"method {shader}: fog.glsl, line 2: `nowhere' undeclared: {text.splitlines()[1]}".replace(
            "BRIGHT", "nowhere"
        ),
        pytest.approx(0.3),
    )
    assert write("2.0") == ("", pytest.approx(0.6))


def test_another_tab_takes_over_and_the_first_is_told(view):
    session, page = view("open-fog", "unshadowed")
    other = Page(session)
    session.opened(other)
    turns(session, lambda: other.frames)
    assert page.said[-1] == {"kind": "closed", "message": "this view was opened in another tab"}
    assert other.last("opened")["scene"] == "open-fog"
    session.closed(page)
    assert session._page is other


@pytest.mark.claim("view-widgets")
def test_widgets_follow_from_the_records(view):
    _, page = view("open-fog", "ray-march", steps=2)
    parameters = {item["name"]: item for item in page.last("state")["parameters"]}
    steps = {name: parameters["steps"][name] for name in ("value", "kind", "whole", "least")}
    assert steps == {"value": 2, "kind": "number", "whole": True, "least": 1}
    assert parameters["spacing"]["kind"] == "choice"
    names = {item["name"] for item in page.last("state")["changeable"]}
    assert {"camera.fov", "light.intensity", "medium.g"} <= names
