# SPDX-License-Identifier: BSD-3-Clause
"""`--model` and `list models`: what is computed, said and refused."""

import json
import shlex
from contextlib import contextmanager

import numpy as np
import pytest

import airlight
from airlight.errors import InputError
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.storage.exr import MODEL, read_exr
from airlight.reports.commands import main as cli
from airlight.validation.scenes.models import PRESETS, model_of, model_words

SIZE = ["--size", "16x12"]
WORDS = "playcanvas:range=8"
TERMS = "light-path=off, law=softened:1:16, range=quartic:8, spot=cosine-smooth"
FOG = """<scene version="3.0.0">{}<sensor type="perspective"><float name="fov" value="41.7"/>
<ref id="fog" name="medium"/>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film></sensor>
<medium type="heterogeneous" id="fog"><volume type="heightfog" name="sigma_t">
<string name="engine" value="{}"/>{}
<transform name="to_world"><scale x="99" y="99" z="60"/></transform></volume>
<float name="albedo" value="0.83"/></medium>
<emitter type="point"><point name="position" x="0.7" y="0.3" z="4.9"/></emitter></scene>"""
SUN = """<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="41.7"/>
<ref id="fog" name="medium"/>
<film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film></sensor>
<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.1"/><float name="albedo" value="0.83"/></medium>
<emitter type="directional"><vector name="direction" x="0.3" y="0.2" z="-1"/></emitter></scene>"""
NAMED = '<default name="airlight-model" value="light-path=off"/>'
PLAYCANVAS = '<float name="density" value="0.1"/><float name="heightFalloff" value="0.6"/>'
UNREAL = '<float name="FogDensity" value="2"/><float name="FogHeightFalloff" value="2"/>'

pytestmark = [pytest.mark.usefixtures("variant"), pytest.mark.claim("model-words")]


def printed(capfd, *words, status=0) -> str:
    capfd.readouterr()
    assert cli.run(words) == status
    out, err = capfd.readouterr()
    return err if status else out


def test_text_and_json_and_the_header_name_the_model(tmp_path, capfd):
    own = str(tmp_path / "own.exr")
    words = ["reference", "sphere-spot", *SIZE, "--model", WORDS, "-o", own]
    first, second, *_ = printed(capfd, *words).splitlines()
    assert first == "sphere-spot, the reference of the model playcanvas 2.23.3 by quadrature"
    assert second.startswith(f"  model  playcanvas 2.23.3: {TERMS}, ")
    model = model_of(WORDS)
    assert read_exr(tmp_path / "own.exr").attributes[MODEL] == model_words(model)
    result = json.loads(printed(capfd, *words, "--json"))["result"]
    assert result["model"] == {"name": "playcanvas 2.23.3", "terms": model.terms}
    # The physical one is `the reference`, whatever it is called.
    for physical in ([], ["--model", "physical"]):
        told = printed(capfd, "reference", "sphere-spot", *SIZE, "-o", own, *physical)
        assert told.startswith("sphere-spot, the reference by quadrature\n")
        assert "model" not in told
    assert MODEL not in read_exr(tmp_path / "own.exr").attributes


def test_from_python_a_model_is_words_or_a_record():
    exact = airlight.reference("open-fog", size=(16, 12))
    named = airlight.reference("open-fog", model="light-path=off", size=(16, 12))
    record = airlight.reference("open-fog", model=Model(light_path="off"), size=(16, 12))
    np.testing.assert_array_equal(named.airlight, record.airlight)
    assert (named.airlight > exact.airlight).all()
    assert named.model == {"name": "", "terms": "light-path=off"}
    assert named.title == "open-fog, the reference of the model light-path=off by quadrature"
    assert exact.model is None
    # A scene keeps the model with which it was loaded; a reference may have another.
    scene = airlight.load_scene("open-fog", (16, 12), model="light-path=off")
    np.testing.assert_array_equal(airlight.reference(scene).airlight, named.airlight)
    plain = airlight.reference(scene, model="physical")
    np.testing.assert_array_equal(plain.airlight, exact.airlight)
    with pytest.raises(InputError, match=r"^model: got 3, expected words such as"):
        airlight.reference("open-fog", model=3)


def test_a_scene_file_names_its_model_and_the_option_wins(tmp_path, capfd):
    path = tmp_path / "own.xml"
    named = '<default name="airlight-model" value="light-path=off"/>'
    path.write_text(FOG.format(named, "playcanvas", PLAYCANVAS))
    own = ["-o", str(tmp_path / "own.exr")]
    assert " of the model light-path=off by" in printed(capfd, "reference", str(path), *own)
    told = printed(capfd, "reference", str(path), "--model", "physical", *own)
    assert told.startswith("own, the reference by quadrature\n")
    told = printed(capfd, "reference", str(path), "--model", WORDS, *own)
    assert " of the model playcanvas 2.23.3 by" in told
    error = printed(capfd, "reference", str(path), "--estimator", "volpath", *own, status=2)
    assert "model: got light-path=off, but volpath solves Mitsuba's own law" in error


@pytest.mark.parametrize("estimator", ["volpath", "cloud-paths"])
def test_estimators_of_the_physical_equation_refuse_others(estimator, tmp_path, capfd):
    words = ["reference", "open-fog", *SIZE, "--estimator", estimator, "--model", WORDS]
    error = printed(capfd, *words, "-o", str(tmp_path / "no.exr"), status=2)
    assert f"but {estimator} solves" in error
    assert "take quadrature or single-scatter, or --model physical" in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "no.exr").exists()


def test_files_of_two_models_are_not_merged(tmp_path, capfd):
    terms = model_of(WORDS).terms  # the same model, without its name
    files = []
    for seed, model in ((0, WORDS), (100, terms), (200, "light-path=off"), (300, "physical")):
        path = str(tmp_path / f"{seed}.exr")
        words = ["reference", "open-fog", *SIZE, "--estimator", "single-scatter", "-o", path]
        assert cli.run([*words, "--samples", "64", "--seed", str(seed), "--model", model]) == 0
        files.append(path)

    def merge(*names, **options):
        merged = [word for name in names for word in ("--merge", name)]
        out = str(tmp_path / "m.exr")
        return printed(capfd, "reference", "open-fog", *merged, "-o", out, **options)

    assert merge(*files[:2]).startswith("open-fog, the reference of the model playcanvas 2.23.3")
    assert read_exr(tmp_path / "m.exr").attributes[MODEL] == model_words(model_of(WORDS))
    for other in files[2:]:
        assert "are of two models, playcanvas 2.23.3: light" in merge(files[0], other, status=2)
    assert "light-path=off and physical; merge" in merge(*files[2:], status=2)
    options = ["--merge", files[0], "--merge", files[1], "--model", WORDS]
    error = printed(capfd, "reference", "open-fog", *options, "-o", "m.exr", status=2)
    assert "leave out model" in error


@pytest.mark.parametrize("estimator", ["quadrature", "single-scatter"])
def test_workers_compute_the_model_that_is_asked_for(estimator, tmp_path, monkeypatch, capfd):
    pytest.importorskip("distributed", reason="the extra `sweep` is not installed")
    from airlight.reports.cluster.run import _outcome

    class Workers:
        """A stub of a cluster: this process does its tasks."""

        def scheduler_info(self, **how):
            return {"workers": {"one": {}}}

    @contextmanager
    def connected(place, **how):
        yield Workers()

    def run_groups(cluster, groups, *, made):
        return (_outcome(task) for group in groups for task in group.tasks)

    monkeypatch.setattr("airlight.reports.cluster.connect.connected", connected)
    monkeypatch.setattr("airlight.reports.cluster.references.run_groups", run_groups)
    monkeypatch.setattr("airlight.reports.cluster.references.facts", lambda: None)
    words = ["reference", "open-fog", "--size", "8x6", "--estimator", estimator, "--model", WORDS]
    words += [] if estimator == "quadrature" else ["--samples", "64"]
    images = []
    for name, more in (("here", []), ("there", ["--cluster", "local:1"])):
        monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / f"cache-{name}"))
        assert cli.run([*words, *more, "-o", str(tmp_path / f"{name}.exr")]) == 0
        images.append((tmp_path / f"{name}.exr").read_bytes())
    assert images[0] == images[1]


def test_models_are_listed_with_what_was_read_and_what_was_not_checked(capfd):
    told = printed(capfd, "list", "models")
    rows = json.loads(printed(capfd, "list", "models", "--json"))["result"]["models"]
    assert [row["name"] for row in rows] == list(PRESETS)
    for row, preset in zip(rows, PRESETS.values(), strict=True):
        assert row["engine"] == f"{preset.title} {preset.version}"
        assert (row["read"], row["unchecked"]) == (preset.read, preset.unchecked)
        assert all(each.words in row["parameters"] for each in preset.parameters)
        assert row["name"] in told
        assert preset.unchecked in told
    assert rows[0]["terms"].startswith(
        "light-path=off, camera-path={extinction}, law=softened:1:16"
    )


def test_describe_tells_the_model_and_suggests_one(tmp_path, capfd):
    path = tmp_path / "own.xml"

    def described(engine, numbers, *words, named=""):
        path.write_text(FOG.format(named, engine, numbers))
        told = printed(capfd, "describe", str(path), *words).splitlines()
        return [line for line in told if line.startswith(("model ", "--model "))]

    line = "--model playcanvas solves this engine's own equation (PlayCanvas)"
    assert described("playcanvas", PLAYCANVAS) == [line]
    (told,) = described("playcanvas", PLAYCANVAS, "--model", WORDS)
    assert told.startswith(f"model  playcanvas 2.23.3: {TERMS}, ")
    assert described("playcanvas", PLAYCANVAS, "--model", "physical") == []
    named = '<default name="airlight-model" value="godot"/>'
    (told,) = described("playcanvas", PLAYCANVAS, named=named)
    assert told.startswith("model  godot 4.6: light-path=off, ")
    (line,) = described("unreal-volumetric", UNREAL)
    assert line.startswith("--model unreal:froxel=NUMBER solves")
    assert described("unreal", UNREAL) == []
    data = json.loads(printed(capfd, "describe", str(path), "--model", WORDS, "--json"))["result"]
    assert data["model"] == {"name": "playcanvas 2.23.3", "terms": model_of(WORDS).terms}
    data = json.loads(printed(capfd, "describe", "open-fog", "--json"))["result"]
    assert data["model"] is None


def test_the_command_of_a_description_judges_by_its_model(tmp_path, capfd):
    """The command that `describe` prints calls the image of the model right."""
    path, own = tmp_path / "own.xml", tmp_path / "own.exr"
    path.write_text(FOG.format(NAMED, "playcanvas", PLAYCANVAS))

    def judged(*words):
        told = printed(capfd, "describe", *words).splitlines()
        (line,) = (each for each in told if each.startswith("to judge it: airlight "))
        return shlex.split(line)[4:]

    # Words of the user as they are; a file names its model itself.
    assert judged("sphere-spot", "--model", WORDS)[3:] == ["--model", WORDS]
    assert judged("sphere-spot", "--model", "physical")[3:] == ["--model", "physical"]
    assert judged(str(path))[3:] == []
    # A scene from Python has words where its name alone would be another model.
    for scene, model, words in (
        ("sphere-spot", "godot", model_of("godot").terms),
        ("sphere-spot", "physical", ""),
        (path, "physical", "physical"),
        (path, "light-path=off", "light-path=off"),
    ):
        told = airlight.describe(airlight.load_scene(scene, model=model))
        assert told.asked == words
    command = judged("open-fog", *SIZE, "--model", WORDS)
    printed(capfd, "reference", "open-fog", *SIZE, "--model", WORDS, "-o", str(own))
    command[2] = str(own)
    told = printed(capfd, *command, "--pixel", "centre")
    assert "verdict          right" in told


def test_a_description_has_the_medium_of_the_scene_and_not_of_the_model():
    plain = airlight.describe("open-fog").to_dict()
    three = airlight.describe("open-fog", model="three").to_dict()
    assert {name for name in plain if plain[name] != three[name]} == {"model"}
    with pytest.raises(InputError, match=r"variants: .*leave out model"):
        airlight.describe("open-fog", model="three", variants="all", output="x")


def test_a_sun_that_physics_drowns_is_described_by_a_model(tmp_path, capfd):
    path = tmp_path / "sun.xml"
    path.write_text(SUN)
    assert "medium without bounds" in printed(capfd, "describe", str(path), status=2)
    glb = str(tmp_path / "sun.glb")
    words = ["describe", str(path), "--model", "babylon:enableExtinction=1", "-o", glb]
    assert "model  babylon 9.35: light-path=off, lamps=0" in printed(capfd, *words)
    # An image that is wrong by its own equation is judged too.
    own = str(tmp_path / "own.exr")
    printed(capfd, "reference", str(path), "--model", "light-path=off", "-o", own)
    other = "light-path=off,camera-path=0.5"
    told = printed(capfd, "compare", str(path), own, "--model", other, "--pixel", "centre")
    assert "model against physics              -            -            -   no reference" in told
    assert "verdict          not right" in told


def test_the_physical_model_is_public():
    assert airlight.Model() == PHYSICAL
    assert airlight.Model(light_path="off").terms == "light-path=off"


def test_a_fit_takes_the_model_of_the_option(tmp_path, capfd):
    own = str(tmp_path / "own.exr")
    words = ["open-fog", *SIZE, "--model", WORDS, "--change", "medium.sigma_t=0.3"]
    printed(capfd, "reference", *words, "-o", own)
    fit = ["compare", "open-fog", own, "--fit", "sigma_t", "--pixel", "centre"]
    told = json.loads(printed(capfd, *fit, "--model", WORDS, "--json"))["result"]
    assert told["model"] == {"name": "playcanvas 2.23.3", "terms": model_of(WORDS).terms}
    assert told["parameters"][0]["value"] == pytest.approx(0.3, rel=1e-4)
    told = json.loads(printed(capfd, *fit, "--json"))["result"]
    assert told["model"] is None
    assert told["parameters"][0]["value"] < 0.15  # physics takes its light path for thinner fog
