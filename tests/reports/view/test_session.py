# SPDX-License-Identifier: BSD-3-Clause
"""What the page asks for is shown, mistakes are one line, and the command on the page makes the same image."""

import json
import shlex
import time

import mitsuba as mi
import numpy as np
import pytest

from reference.storage.exr import read_exr
from reports.commands import main as cli
from reports.view.session import Session, sparing
from reports.view.state import ViewState
from validation.configurations.methods import configuration
from validation.scenes.loading import load_scene

SIZE = (40, 30)
AIM = {"camera.origin": [0.61, -0.3, 0.4], "camera.target": [0.2, 0.1, 4.0], "camera.up": [0, 1, 0]}


class Page:
    """A page that keeps what it is told, as JSON holds it, and shows each frame at once."""

    def __init__(self, session):
        self.session, self.said, self.frames, self.others = session, [], [], []

    def tell(self, kind, **values):
        self.said.append(json.loads(json.dumps({"kind": kind} | values, allow_nan=False)))

    def show(self, picture, **values):
        json.dumps(values, allow_nan=False)
        kept = self.frames if values["kind"] == "frame" else self.others
        kept.append(values | {"picture": np.frombuffer(picture, np.uint8).reshape(SIZE[1], SIZE[0], 4)})
        if values["kind"] == "frame":
            self.session.told(self, {"kind": "drawn", "frame": values["frame"]})

    def close(self, why):
        self.said.append({"kind": "closed", "message": why})

    def last(self, kind):
        return next(said for said in reversed(self.said) if said["kind"] == kind)


def turns(session, until, limit=120):
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
def view(variant):
    kept = []

    def start(*scene, **how):
        kept.append(opened(*scene, **how))
        return kept[-1]

    yield start
    for session, _ in kept:
        session.truth.end()


def ask(session, page, **message):
    before = len(page.frames)
    session.told(page, message)
    turns(session, lambda: len(page.frames) > before and session._told >= session._changed_at)


def xml_scene(folder):
    """The scene `open-fog` as a file of Mitsuba's."""
    from validation.scenes.registry import SCENES

    path = folder / "my scene.xml"
    mi.parser.write_file(
        mi.parser.parse_dict(mi.parser.ParserConfig(mi.variant()), SCENES["open-fog"].build()), str(path)
    )
    return str(path)


@pytest.mark.claim("view-command", tolerance="bit by bit")
@pytest.mark.parametrize("scene", ["sphere-spot", "xml"])
def test_the_command_on_the_page_renders_what_is_shown(view, tmp_path, scene):
    if scene == "xml":
        scene = xml_scene(tmp_path)
    session, page = view(scene)
    ask(session, page, kind="change", changes=AIM)
    ask(session, page, kind="change", changes={"light.position": [0.4, 0.3, 4.2], "medium.sigma_t": [0.29]})
    ask(session, page, kind="choose", method="ray-march")
    ask(session, page, kind="choose", parameter="steps", value="23")
    ask(session, page, kind="choose", parameter="sum", value="transitions")
    ask(session, page, kind="choose", kernel="quadrature-12")
    ask(session, page, kind="change", changes={"camera.fov": [41.3], "medium.albedo": [0.7, 0.6, 0.5]})
    command = shlex.split(page.last("state")["commands"]["render"])
    assert command[:3] == ["airlight", "render", scene]
    assert cli.run([*command[1:], "-o", str(tmp_path / "same.exr")]) == 0
    written = read_exr(tmp_path / "same.exr").layers
    frame = session.live.on_host(session.live.frame())
    np.testing.assert_array_equal(written["airlight"], frame.airlight.astype(np.float32))
    np.testing.assert_array_equal(written["surface"], frame.surface.astype(np.float32))
    assert np.abs(page.frames[0]["picture"].astype(int) - page.frames[-1]["picture"]).max() > 0


@pytest.mark.claim("view-command", tolerance="bit by bit")
def test_the_other_commands_show_the_same_and_its_truth(view, tmp_path, monkeypatch):
    session, page = view()
    ask(session, page, kind="change", changes=AIM | {"light.intensity": [31.0, 43.0, 57.0]})
    ask(session, page, kind="choose", parameter="tolerance", value=0.01)
    commands = page.last("state")["commands"]
    started = []
    monkeypatch.setattr("reports.view.session.Session", lambda state, variant: started.append(state) or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        cli.run(shlex.split(commands["view"])[1:])
    assert started == [session._state()]
    assert cli.run([*shlex.split(commands["reference"])[1:], "-o", str(tmp_path / "truth.exr")]) == 0
    turns(session, lambda: session.truth.done)
    written = read_exr(tmp_path / "truth.exr").layers["airlight"]
    np.testing.assert_allclose(session.truth.truth.airlight, written, rtol=1e-6)


@pytest.mark.claim("view-error", tolerance="1e-6 relative: EXR rounds to float32")
def test_error_converges_to_that_of_compare_and_starts_again_when_the_scene_changes(view, tmp_path, capfd):
    session, page = view("sphere-spot", "ray-march", steps=7)
    ask(session, page, kind="show", other="truth")
    turns(session, lambda: any(said.get("done") for said in page.said if said["kind"] == "error"))
    error = page.last("error")["error"]
    assert error["known"] == error["pixels"] == SIZE[0] * SIZE[1]
    assert 0 < error["bound"] < 1e-6
    commands = page.last("state")["commands"]
    method, truth = str(tmp_path / "method.exr"), str(tmp_path / "truth.exr")
    assert cli.run([*shlex.split(commands["render"])[1:], "-o", method]) == 0
    assert cli.run([*shlex.split(commands["reference"])[1:], "-o", truth]) == 0
    capfd.readouterr()
    assert cli.run(["compare", truth, method, "--json"]) == 0
    compared = json.loads(capfd.readouterr().out)
    assert error["relative_rmse"] == pytest.approx(compared["relative_rmse"], rel=1e-5)
    assert error["relative_bias"] == pytest.approx(compared["relative_bias"], rel=1e-4)
    # Another method has the same truth; another scene has not.
    number = session.truth._number
    ask(session, page, kind="choose", parameter="steps", value=21)
    assert session.truth._number == number
    turns(session, lambda: page.last("error")["error"]["relative_rmse"] < 0.5 * error["relative_rmse"])
    ask(session, page, kind="change", changes={"medium.sigma_t": [0.5]})
    assert session.truth.truth is None or not session.truth.done
    turns(session, lambda: page.last("error").get("done"))
    assert page.others[-1]["known"] == page.others[-1]["pixels"]
    assert page.last("error")["error"]["relative_rmse"] != error["relative_rmse"]


def test_pictures_beside_the_method_are_its_truth_and_its_error(view):
    session, page = view("sphere-spot", "shadow-planes")
    for beside in ("truth", "error"):
        page.others.clear()
        ask(session, page, kind="show", other=beside)
        turns(session, lambda: page.others and page.others[-1]["known"] == page.others[-1]["pixels"])
        picture, method = page.others[-1]["picture"].astype(int), page.frames[-1]["picture"]
        if beside == "truth":  # the method is exact here
            assert np.abs(picture - method).mean() < 0.5
        else:
            assert picture[..., :3].mean() > 240  # errors below 1e-4 are white


@pytest.mark.parametrize(
    ("message", "says"),
    [
        ({"kind": "choose", "parameter": "tolerence", "value": 1}, "did you mean 'tolerance'?"),
        ({"kind": "choose", "parameter": "tolerance", "value": "much"}, "wanted a number"),
        ({"kind": "choose", "parameter": "tolerance", "value": -1}, "tolerance: got -1"),
        ({"kind": "choose", "method": "shadow-plains"}, "did you mean 'shadow-planes'?"),
        ({"kind": "choose", "kernel": "exakt"}, "did you mean 'exact'?"),
        ({"kind": "change", "changes": {"medium.sigma_t": [-1]}}, "medium.sigma_t: got -1"),
        ({"kind": "change", "changes": {"medium.sigma": [1]}}, "did you mean 'medium.sigma_t'?"),
        ({"kind": "change", "changes": {"light.position": [1, 2]}}, "got 2 numbers, wanted 3"),
    ],
)
def test_a_mistake_is_one_line_and_changes_nothing(view, message, says):
    session, page = view()
    state = session._state()
    session.told(page, message)
    turns(session, lambda: page.said and any(said["kind"] == "mistake" and said["message"] for said in page.said))
    told = page.last("mistake")["message"]
    assert says in told
    assert "\n" not in told
    assert session._state() == state
    ask(session, page, kind="change", changes={"medium.sigma_t": [0.3]})
    assert page.last("mistake")["message"] == ""


@pytest.mark.parametrize(
    "message",
    [{}, {"kind": "nonsense"}, {"kind": "change"}, {"kind": "change", "changes": {"a": "b", "c": [None]}},
     {"kind": "show", "layer": "no such", "exposure": "bright"}, {"kind": "drawn", "frame": "x"},
     {"kind": "choose", "parameter": None, "value": None}, {"kind": "choose", "method": {}}],
)  # fmt: skip
def test_no_message_ends_the_view(view, message):
    session, page = view()
    session.told(page, message)
    session.turn()
    ask(session, page, kind="change", changes={"medium.sigma_t": [0.3]})
    assert session.live.changes == {"medium.sigma_t": (0.3,)}


def test_changes_that_wait_are_one_frame(view):
    session, page = view()
    turns(session, lambda: session._told >= session._changed_at)
    before = len(page.frames)
    for number in range(20):
        session.told(page, {"kind": "change", "changes": {"camera.origin": [0.01 * number, 0.0, 0.0]}})
    session.turn()
    assert len(page.frames) == before + 1
    assert session.live.changes["camera.origin"] == (0.19, 0.0, 0.0)


def test_of_the_values_of_a_slider_the_last_is_chosen(view, monkeypatch):
    session, page = view("sphere-spot", "ray-march")
    chosen = []
    choose = session.live.choose
    monkeypatch.setattr(session.live, "choose", lambda wanted: chosen.append(wanted) or choose(wanted))
    for steps in range(2, 20):
        session.told(page, {"kind": "choose", "parameter": "steps", "value": steps})
    session.told(page, {"kind": "choose", "parameter": "spacing", "value": "uniform"})
    session.turn()
    assert [dict(wanted.parameters) for wanted in chosen] == [{"steps": 19}, {"steps": 19, "spacing": "uniform"}]


def test_frames_wait_for_a_page_that_shows_them(view):
    session, page = view()
    page.session = type("Nobody", (), {"told": lambda *_: None})()
    session.told(page, {"kind": "show", "run": True})
    before = len(page.frames)
    for _ in range(6):
        if session._can_draw() or session._said:
            session.turn()
    assert len(page.frames) - before <= 2


def test_another_tab_takes_over_and_the_first_is_told(view):
    session, page = view()
    other = Page(session)
    session.opened(other)
    turns(session, lambda: other.frames)
    assert page.said[-1] == {"kind": "closed", "message": "this view was opened in another tab"}
    assert other.last("opened")["scene"] == "sphere-spot"
    session.closed(page)
    assert session._page is other


def test_widgets_follow_from_the_records(view):
    _, page = view("soft-hall", "ray-march")
    parameters = {item["name"]: item for item in page.last("state")["parameters"]}
    assert parameters["steps"] | {"help": ""} == {
        **{"name": "steps", "value": 100, "help": "", "unit": parameters["steps"]["unit"]},
        **{"kind": "number", "whole": True, "least": 1, "most": parameters["steps"]["most"]},
    }
    assert parameters["spacing"]["kind"] == "choice"
    assert {"points", "pattern"} <= set(parameters)  # of lights with extent
    names = [item["name"] for item in page.last("state")["changeable"]]
    assert {"camera.fov", "light.radiance", "medium.g"} <= set(names)
    assert [method["name"] for method in page.last("opened")["methods"]][:2] == ["unshadowed", "ray-march"]


def test_a_configuration_names_what_differs_and_no_more(variant):
    assert sparing("ray-march", "exact", {"steps": "100"}) == configuration("ray-march")
    assert sparing("ray-march", "taylor", {"steps": 17, "sum": "transitions"}) == configuration(
        "ray-march", "taylor", {"steps": 17, "sum": "transitions"}
    )


def test_own_xml_scenes_load(variant, tmp_path):
    assert load_scene(xml_scene(tmp_path), SIZE).scene.emitters()
