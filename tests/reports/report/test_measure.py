# SPDX-License-Identifier: BSD-3-Clause
"""A report holds what its study asks for, in whole files; kept parts are found
again, and efforts add parts.
"""

import importlib
import json
from dataclasses import asdict, replace
from functools import wraps
from types import SimpleNamespace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.child_process import EndedError
from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.reports.data.records import named_files, read_report, report_text
from airlight.reports.report.measure import write_report
from airlight.reports.report.others import other_parts
from airlight.reports.report.scene import file_stems, folder_of, reference_record
from airlight.validation.kernels.records import Stability
from airlight.validation.scenes.names import scene_stem
from airlight.validation.study.configuration import Configuration, configuration
from airlight.validation.study.run import PROBE
from airlight.validation.study.study import STUDIES, Checks, Measure, Study, standard_study
from airlight.validation.timing import Scaling
from tests.helpers.reports import growth_record, record_of, stable
from tests.helpers.scenes import LAMP, scene_xml

FLOOR = (
    '<shape type="rectangle"><transform name="to_world"><scale value="6.3"/></transform></shape>'
)
FOG = '<float name="sigma_t" value="0.31"/><rgb name="albedo" value="0.9, 0.8, 0.7"/>'
FOG += '<phase type="tabphase"><string name="values" value="0.3, 0.2, 0.4, 0.9, 2.0"/></phase>'
SCENE = scene_xml(LAMP, FLOOR, fog=FOG, size=(16, 12))
MARCH = Configuration("ray-march", None, (("steps", 50),))
CHOSEN = (Configuration("unshadowed", "taylor"), Configuration("unshadowed", "quadrature"), MARCH)
# Numbers of samples and no times: what two runs find must not hang on how busy the machine is.
TINY = Study(
    "tiny",
    sizes=((20, 15),),
    configurations=CHOSEN,
    measure=Measure("stages", 0.01, (12, 9), slow=0.04, limit=1e6, every_metric=False),
    checks=Checks(
        (10, 8),
        {"single-scatter": 0.2, "volpath": 0.5},
        {"single-scatter": 4, "volpath": 4},
        32,
        (4, 1),
    ),
)


@pytest.fixture(scope="module")
def monkeypatch_of_module():
    with pytest.MonkeyPatch.context() as patch:
        yield patch


@pytest.fixture(scope="module")
def cache_of_module(tmp_path_factory):
    """A cache of these tests alone: another process may make the same report at the same time."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def _cache_of_module(monkeypatch, cache_of_module):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(cache_of_module))


def as_json(report):
    return json.loads(report_text(report))


@pytest.fixture(scope="module")
def written(variant, tmp_path_factory, cache_of_module, monkeypatch_of_module):
    """A report of one small scene; taylor refuses its tabulated phase function."""
    monkeypatch_of_module.setenv("AIRLIGHT_CACHE_DIR", str(cache_of_module))
    folder = tmp_path_factory.mktemp("report")
    (folder / "my <fog>.xml").write_text(SCENE)
    told = []
    report = write_report(
        folder / "out" / "here",
        replace(TINY, scenes=(str(folder / "my <fog>.xml"),)),
        command="airlight report --tiny",
        progress=lambda fraction, what: told.append((fraction, what)),
    )
    return SimpleNamespace(
        folder=folder / "out" / "here", report=report, data=as_json(report), told=told
    )


@pytest.mark.claim("report-schema", "refusals-stand-in-the-report")
def test_the_data_are_read_again_and_every_file_that_they_name_is_there(written):
    data = json.loads((written.folder / "report.json").read_text(encoding="utf-8"))
    assert data == written.data
    assert report_text(read_report(written.folder)) == report_text(written.report)
    assert data["command"] == "airlight report --tiny"
    # The settings are the study's own records, and come back from the file as they were.
    asked = read_report(written.folder).settings
    assert asked == replace(TINY.settings, scenes=asked.scenes)
    assert (asked.timed_size, len(asked.scenes)) == ((12, 9), 1)
    assert asked.scenes[0].endswith("my <fog>.xml")
    (scene,) = data["scenes"]
    assert (scene["name"], scene["size"]) == ("my <fog>", [20, 15])
    checks = {
        f"{estimator} {layer}"
        for estimator in TINY.checks.margins
        for layer in ("airlight", "surface")
    }
    assert set(scene["agreement"]) == checks
    assert 0 < scene["multiple"]["medium"]["value"] < 1
    assert [entry["label"] for entry in scene["methods"]] == [
        configuration.label for configuration in CHOSEN
    ]
    taylor = scene["methods"][0]
    assert "tabulated" in taylor["reason"]
    assert taylor["files"] == {}
    assert taylor["times"] is taylor["error"] is None
    named = [
        *scene["files"].values(),
        *(name for entry in scene["methods"] for name in entry["files"].values()),
    ]
    assert len(named) == len(set(named)) == 3 + 2 * 3
    there = {
        str(path.relative_to(written.folder))
        for path in written.folder.rglob("*")
        if path.is_file()
    }
    assert there == {*named, "report.json", "report.html"}
    assert all((written.folder / name).stat().st_size > 0 for name in there)


def test_images_can_be_read_and_give_the_errors_of_the_table(written):
    from airlight.validation.metrics.errors import error_metrics

    (scene,) = written.data["scenes"]
    reference = read_exr(written.folder / scene["files"]["exr"])
    assert set(reference.layers) >= {"airlight", "airlight_bound", "surface"}
    assert reference.attributes["airlight:estimator"] == "quadrature"
    assert reference.layers["airlight"].shape == (15, 20, 3)
    for entry in scene["methods"][1:]:
        image = read_exr(written.folder / entry["files"]["exr"])
        errors = error_metrics(reference.layers["airlight"], image.layers["airlight"])
        # The file of the reference is rounded to float32: 6e-8 of the mean in each pixel.
        assert errors.relative_rmse == pytest.approx(entry["error"]["relative_rmse"], abs=2e-7)
        assert errors.relative_bias == pytest.approx(entry["error"]["relative_bias"], abs=2e-7)
        assert image.attributes["airlight:method"] == entry["method"]
    assert image.attributes["airlight:steps"] == "50"


def again(written, tmp_path, **options):
    """The same report, into another folder."""
    fresh = options.pop("fresh", False)
    study = replace(TINY, **({"scenes": (written.data["scenes"][0]["path"],)} | options))
    return as_json(write_report(tmp_path / "again", study, fresh=fresh))


@pytest.mark.claim("report-kept")
def test_a_second_report_is_kept_in_full(written, variant, tmp_path):
    repeated = again(written, tmp_path)
    assert (repeated["cached"], repeated["computed"]) == (3 + len(CHOSEN) + 1, 0)
    assert repeated["measured"] == written.data["measured"]
    (scene,), (scene_after,) = written.data["scenes"], repeated["scenes"]
    assert [m["cached"] for m in scene_after["methods"]] == [True] * len(CHOSEN)
    for before, after in zip(scene["methods"], scene_after["methods"], strict=True):
        assert before | {"cached": True} == after
    assert {name: scene[name] for name in scene if name != "methods"} == {
        name: scene_after[name] for name in scene_after if name != "methods"
    }
    for name in named_files(written.report):
        assert (tmp_path / "again" / name).read_bytes() == (written.folder / name).read_bytes()


@pytest.mark.claim("times-of-one-run")
def test_a_new_method_takes_its_errors_alone_and_times_of_all_in_one_run(
    written, variant, tmp_path
):
    """Times of a busy hour once stood beside a user's method of the minute."""
    new = Configuration("ray-march", None, (("steps", 7),))
    repeated = again(written, tmp_path, configurations=(*CHOSEN, new))
    assert (repeated["cached"], repeated["computed"]) == (3 + len(CHOSEN), 1 + 1)
    before, after = (report["scenes"][0]["methods"] for report in (written.data, repeated))
    assert [row["cached"] for row in after] == [True] * len(CHOSEN) + [False]
    for old, now in zip(before, after, strict=False):
        assert (old["error"], old["measured"]) == (now["error"], now["measured"])
    timed = [row["times"] for row in after if row["times"]]
    assert len(timed) == len(CHOSEN)  # taylor refuses
    assert all(times["run"] == timed[0]["run"] for times in timed)
    assert all(
        row["times"] != now["times"]
        for row, now in zip(before, after, strict=False)
        if row["times"]
    )
    assert timed[0]["run"]["anchor"]["median_ms"] > 0
    # The first group is still there, whole, with its date.
    assert [row["times"] for row in again(written, tmp_path)["scenes"][0]["methods"]] == [
        row["times"] for row in before
    ]


@pytest.mark.claim("report-kept")
def test_fresh_computes_references_and_batches_again_too(written, variant, tmp_path, monkeypatch):
    from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
    from airlight.reference.quadrature.image import quadrature_image

    calls = []

    def counted(function):
        @wraps(function)
        def call(*arguments, **options):
            calls.append(function)
            return function(*arguments, **options)

        return call

    # Half the time: what `fresh` tells one estimator it tells both.
    checks = replace(TINY.checks, margins={"single-scatter": 0.2}, samples={"single-scatter": 4})
    # by its name in `sys.modules`: `airlight.reference` is a function too
    module = importlib.import_module("airlight.reference.quadrature.reference")
    monkeypatch.setattr(module, "quadrature_image", counted(quadrature_image))
    monkeypatch.setattr(
        "airlight.validation.estimates.monte_carlo.single_scatter_batch",
        counted(single_scatter_batch),
    )
    multiple = written.data["scenes"][0]["multiple"]
    monkeypatch.setattr(
        "airlight.validation.study.study_scene.multiple_scattering_fraction",
        lambda scene, **options: multiple,
    )
    repeated = again(written, tmp_path, fresh=True, configurations=(MARCH,), checks=checks)
    assert (repeated["cached"], repeated["computed"]) == (0, 3 + 1 + 1)
    assert set(calls) == {quadrature_image, single_scatter_batch}
    # The same numbers, except for the times.
    before, (after,) = written.data["scenes"][0]["methods"][-1], repeated["scenes"][0]["methods"]
    assert before["error"] == after["error"]
    assert before["times"] != after["times"]
    (agreed,) = (scene["agreement"] for scene in repeated["scenes"])
    assert set(agreed) == {"single-scatter airlight", "single-scatter surface"}
    assert agreed == {name: written.data["scenes"][0]["agreement"][name] for name in agreed}


@pytest.mark.claim("report-kept")
def test_a_changed_scene_is_measured_again(written, variant, tmp_path, monkeypatch, own_cache):
    """In a cache of its own: what it finds again replaces what was kept."""
    multiple = written.data["scenes"][0]["multiple"]
    monkeypatch.setattr(
        "airlight.validation.study.study_scene.agreements", lambda scene, margins, **options: {}
    )
    monkeypatch.setattr(
        "airlight.validation.study.study_scene.multiple_scattering_fraction",
        lambda scene, **options: multiple,
    )
    path = tmp_path / "mine.xml"
    counts = []
    for sigma_t in ("0.31", "0.37"):
        path.write_text(SCENE.replace("0.31", sigma_t))
        measured = again(written, tmp_path, scenes=(str(path),), configurations=())
        counts.append((measured["cached"], measured["computed"]))
    assert counts == [(0, 3), (0, 3)]
    assert (
        measured["scenes"][0]["reference"]["mean"] != written.data["scenes"][0]["reference"]["mean"]
    )


@pytest.mark.claim("report-kept")
def test_an_engines_image_is_judged_at_its_size_by_the_reference_that_is_kept(
    written, variant, tmp_path
):
    from airlight.validation.engine.images import EngineImage

    path, (scene,) = tmp_path / "my <fog>.exr", written.data["scenes"]
    image = read_exr(written.folder / scene["files"]["exr"])
    write_exr(path, Image({"airlight": np.float32(1.01) * image.layers["airlight"]}))
    shown = {scene_stem(scene["path"]): (EngineImage("my <fog>", "engine", path),)}
    study = replace(TINY, scenes=(scene["path"],), sizes=((16, 12),), configurations=())
    data = as_json(write_report(tmp_path / "again", study, images=shown))
    (judged,) = data["scenes"]
    assert judged["size"] == [20, 15]  # that of the image
    assert data["computed"] == 1  # the image
    (row,) = judged["methods"]
    assert (row["kind"], row["label"], row["times"]) == ("image", "engine", None)
    assert row["error"]["relative_bias"] == pytest.approx(0.01, rel=1e-4)
    assert any(
        "The image engine of my <fog>, judged by its airlight" in claim["text"]
        for claim in data["claims"]
    )


# Methods of the user


def at_fault(view, *, kernel=None):
    return {}["nothing"]


def fails_in_small_frames(view, *, kernel=None):
    if len(view.pixel) < 64 * 48:
        raise RuntimeError("too small")
    return 1.0


@pytest.mark.claim("own-method-faults", "files-whole-or-not-at-all")
@pytest.mark.parametrize(
    ("method", "words"),
    [(at_fault, r"KeyError: 'nothing'$"), (fails_in_small_frames, r"RuntimeError: too small$")],
    ids=["in the first small frame", "in a frame of the report"],
)
def test_a_fault_of_a_function_that_runs_here_ends_the_report_and_nothing_is_written(
    written, variant, tmp_path, method, words
):
    with pytest.raises(InputError, match=rf"test_measure\.py, line \d+: {words}"):
        again(written, tmp_path, configurations=(configuration(method),))
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


@pytest.mark.claim("own-method-process")
def test_a_method_that_ends_its_process_is_told_at_once_and_is_a_row_with_the_reason(
    written, variant, tmp_path, monkeypatch, capsys
):
    calls = []

    def ends(function, cell, *, name):
        calls.append(cell.size)
        raise EndedError(f"method {name}: ended its process, killed by SIGABRT")

    monkeypatch.setattr("airlight.reports.report.measure.in_own_process", ends)
    study = replace(
        TINY, scenes=(written.data["scenes"][0]["path"],), configurations=(configuration(at_fault),)
    )
    (ended,) = write_report(tmp_path / "again", study, apart=True).scenes[0].methods
    assert (ended.status, ended.times) == ("refused", None)
    assert ended.reason.endswith("ended its process, killed by SIGABRT")
    assert capsys.readouterr().err == f"airlight: warning: {ended.reason}; the report goes on\n"
    assert calls == [PROBE]  # it is not called again


def test_a_refusal_by_a_users_method_is_no_fault(written, variant, tmp_path, monkeypatch, capsys):
    def refuses(function, cell, *, name):
        raise InputError("the medium has bounds")

    monkeypatch.setattr("airlight.reports.report.measure.in_own_process", refuses)
    study = replace(
        TINY, scenes=(written.data["scenes"][0]["path"],), configurations=(configuration(at_fault),)
    )
    (row,) = write_report(tmp_path / "again", study, apart=True).scenes[0].methods
    assert (row.status, row.reason) == ("refused", "the medium has bounds")
    assert capsys.readouterr().err == ""


def test_the_device_of_shaders_is_part_of_the_machine(variant, tmp_path, monkeypatch):
    monkeypatch.setattr("airlight.reports.report.measure.require_opengl", lambda: "llvmpipe 25.0")
    for method, device in (("fog.glsl", "llvmpipe 25.0"), ("ray-march", None)):
        report = write_report(tmp_path, replace(TINY, configurations=(Configuration(method),)))
        assert report.environment.opengl == device


# Parts that belong to no scene


def test_stability_and_growth_have_their_records_their_time_and_are_kept(
    written, variant, tmp_path, monkeypatch
):
    """Stubs measure: `tests/validation` has what they measure."""
    from airlight.reports.report import others

    measured = []

    def stability(*given, count):
        measured.append(("stability", count))
        return [record_of(stable("exact", "a bar"), Stability)]

    def growth(study, work, steps, *, progress):
        measured.append((work, study.measure.seconds))
        return [record_of(growth_record(cliff=True), Scaling)]

    monkeypatch.setattr("airlight.validation.kernels.stability.stability", stability)
    monkeypatch.setattr("airlight.validation.study.growth.study_growth", growth)
    monkeypatch.setattr("airlight.validation.study.growth.ladder", lambda *given: [])
    monkeypatch.setattr(others, "in_own_process", lambda function, *given, **how: function(*given))
    small = replace(TINY, scenes=(written.data["scenes"][0]["path"],), configurations=())
    monkeypatch.setattr(others, "standard_study", lambda name: small)
    study = replace(small, stability=17, growth=("size",))
    report = write_report(tmp_path / "one", study)
    assert measured == [("stability", 17), ("size", TINY.measure.seconds)]
    assert [each.broken for each in report.stability] == [("a bar",)]
    assert report.claims[-1].text.startswith("A time jumps: hall, shadow-planes (exact)")
    assert (report.computed, report.cached) == (2, 3)
    assert set(report.parts) == {"scenes", "stability", "scaling", "papers"}
    assert read_report(tmp_path / "one").scaling == report.scaling
    repeated = write_report(tmp_path / "two", study)
    assert len(measured) == 2
    assert (repeated.computed, repeated.cached) == (0, 5)
    assert (repeated.stability, repeated.scaling) == (report.stability, report.scaling)


@pytest.mark.claim("reports-from-clusters")
def test_workers_compute_the_references_and_are_asked_for_the_batches_that_check_them(
    written, variant, tmp_path, monkeypatch, own_cache
):
    """A stub of the workers: `tests/reports/cluster` has processes."""
    pytest.importorskip("distributed", reason="the extra `sweep` is not installed")
    from airlight.reports.cluster.run import _outcome

    sent, spreads = [], []

    def run_groups(cluster, groups, *, made):
        for task in (task for group in groups for task in group.tasks):
            sent.append(task.name)
            yield _outcome(task)

    def agreements(scene, margins, *, spread, **options):
        spreads.append(spread("volpath", 4, None))
        return {}

    monkeypatch.setattr("airlight.reports.cluster.references.facts", lambda: None)
    cluster = SimpleNamespace(scheduler_info=lambda **how: {"workers": {"one": {}, "two": {}}})
    monkeypatch.setattr("airlight.reports.cluster.references.run_groups", run_groups)
    monkeypatch.setattr("airlight.validation.study.study_scene.agreements", agreements)
    multiple = written.data["scenes"][0]["multiple"]
    monkeypatch.setattr(
        "airlight.validation.study.study_scene.multiple_scattering_fraction",
        lambda scene, **options: multiple,
    )
    study = replace(TINY, scenes=(written.data["scenes"][0]["path"],), configurations=())
    data = as_json(write_report(tmp_path / "again", study, cluster=cluster))
    assert sent == ["reference 0"]
    assert data["scenes"][0]["reference"] == written.data["scenes"][0]["reference"]
    ((bring, at_once),) = spreads
    assert callable(bring)
    assert at_once == 2 * 8


@pytest.mark.parametrize(
    ("scene", "folder"),
    [
        ("hall", "hall"),
        ("a/my <fog> #2.xml", "my-fog-2"),
        ("a/..xml", "scene"),
        ("random:7", "random-7"),
    ],
)
def test_a_scene_of_any_name_has_a_safe_folder(scene, folder):
    assert folder_of(scene) == folder


def test_scenes_of_one_name_are_refused_before_the_work(variant, tmp_path):
    """Their images would lie in one folder, and the second would replace the first."""
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "x.xml").write_text(SCENE)
    names = tuple(str(tmp_path / folder / "x.xml") for folder in ("a", "b"))
    with pytest.raises(InputError, match="two scenes are called x"):
        write_report(tmp_path / "out", replace(TINY, scenes=names))


def test_labels_that_would_share_a_file_get_numbers():
    # `x` has the picture x-error.png, which would be that of the label `x error` too.
    stems = file_stems(
        [
            "x",
            "X!",
            "x error",
            "reference",
            "\N{GREEK SMALL LETTER PHI}",
            "my.module:shafts (exact)",
        ]
    )
    assert stems == ["x", "x-2", "x-error-2", "reference-2", "image", "my-module-shafts-exact"]


@pytest.mark.slow
def test_a_report_times_growing_work(variant, tmp_path, monkeypatch):
    from airlight.reports.report import others

    small = replace(others.standard_study("scaling").at((16, 12)), scenes=("open-fog",))
    monkeypatch.setattr(others, "standard_study", lambda name: small)
    data = write_report(tmp_path, replace(TINY, scenes=("open-fog",), growth=("size",)))
    assert len(data.scaling) == 4  # methods
    assert [cost.work for cost in data.scaling[0].costs] == [48, 192, 768, 3072]
    assert "growth" in {claim.kind for claim in data.claims}
    assert data.parts["scaling"] > 0
    assert "As the work grows" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("airlight", [np.zeros((2, 3, 3)), np.full((2, 3, 3), np.inf)])
def test_reference_without_light_that_is_finite_has_no_numbers_rather_than_nan(airlight):
    from airlight.reference.quadrature.image import ReferenceImage

    black = np.zeros_like(airlight)
    found = reference_record(
        ReferenceImage(airlight, black, black, np.ones((2, 3)), np.ones((2, 3)), 0, float("nan"))
    )
    json.dumps(asdict(found), allow_nan=False)
    assert found.relative_error is None
    assert found.missed is None


def test_a_larger_effort_measures_more_verdicts_and_part_of_its_scenes_none(own_cache):
    def papers(study):
        return [part.title for part in other_parts(study) if part.kind == "papers"]

    quick, default, full = (standard_study(name) for name in STUDIES)
    assert papers(quick) == ["formulas", "stencil"]  # no image
    assert set(papers(quick)) < set(papers(default)) < set(papers(full))
    assert (
        papers(replace(default, scenes=("open-fog",))) == papers(replace(quick, name="mine")) == []
    )
