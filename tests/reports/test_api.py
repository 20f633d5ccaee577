# SPDX-License-Identifier: BSD-3-Clause
"""`import airlight`: the functions do what the parts they are made of do, and refuse in one line what they cannot."""

import ast
import doctest
import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import airlight
from analytic.cases import read_cases
from realtime.errors import InputError as RealtimeInputError
from reports.api_inputs import one_error
from validation.scenes import SCENES

ROOT = Path(__file__).resolve().parents[2]
TINY = (16, 12)
FUNCTIONS = ("load_scene", "render", "reference", "compare", "integrate", "bench", "report")


def brighter(view, *, kernel=None, times=2.0):
    """A method of one's own: all of the airlight, unshadowed, times something."""
    from realtime.methods.unshadowed import unshadowed

    return times * unshadowed(view, kernel=kernel)


def gone(view):
    raise ZeroDivisionError("nothing there")


def test_the_names_that_editors_complete_are_those_of_the_api():
    tree = ast.parse((ROOT / "airlight.py").read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)]
    named = {node.names[0].asname: node.module for node in block.body if isinstance(node, ast.ImportFrom)}
    assert named == airlight._API
    assert set(FUNCTIONS) < set(dir(airlight))
    for name in airlight._API:
        assert getattr(airlight, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'no_such'"):
        _ = airlight.no_such


def test_the_import_is_light_and_the_variant_is_chosen_on_first_use():
    code = (
        "import sys, airlight\n"
        "assert not {'numpy', 'mitsuba', 'reports.api'} & set(sys.modules)\n"
        "frame = airlight.render('open-fog', 'unshadowed', size=(8, 6))\n"
        "import mitsuba; assert mitsuba.variant() == airlight.activate(); print(frame)\n"
    )
    ran = subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert ran.stdout == "Rendering(open-fog by unshadowed (exact), 8 x 6)\n", ran.stderr


@pytest.mark.parametrize("module", ["airlight", "reports.api", "reports.api_studies"])
def test_examples_of_the_docstrings(module, variant):
    found = doctest.testmod(importlib.import_module(module))
    assert found.attempted
    assert not found.failed


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_has_parameters_raises_and_an_example(name):
    text = getattr(airlight, name).__doc__
    for heading in ("Parameters", "Raises", "Examples"):
        assert f"{heading}\n    {'-' * len(heading)}\n" in text, heading


def test_both_sides_raise_one_exception():
    @one_error
    def refuses():
        raise RealtimeInputError("no such thing")

    with pytest.raises(airlight.InputError, match="no such thing"):
        refuses()


# Scenes


def test_a_scene_by_name_dictionary_mitsuba_scene_and_again(variant):
    import mitsuba as mi

    scene = airlight.load_scene("open-fog", "16x12")
    assert scene.size == TINY
    assert scene.name == "open-fog"
    assert airlight.load_scene(scene) is scene
    assert airlight.load_scene(scene, TINY) is scene
    named = airlight.load_scene(SCENES["open-fog"].build(), TINY)
    assert named.size == TINY
    assert airlight.load_scene(mi.load_dict(SCENES["open-fog"].build())).size == (800, 600)
    by_name, by_dictionary = (airlight.render(one, "unshadowed") for one in (scene, named))
    np.testing.assert_array_equal(by_name.airlight, by_dictionary.airlight)
    assert "1 point" in scene._repr_html_()


def test_a_scene_that_no_method_can_render_shows_why(variant):
    dark = {name: value for name, value in SCENES["open-fog"].build().items() if not _is_light(value)}
    scene = airlight.load_scene(dark, TINY)
    assert "the scene has no light" in scene._repr_html_()
    with pytest.raises(airlight.InputError, match="the scene has no light"):
        scene.plan()


def _is_light(value):
    return isinstance(value, dict) and value.get("type") in ("point", "spot")


@pytest.mark.parametrize(
    ("scene", "size", "words"),
    [
        ("open-fgo", None, "did you mean 'open-fog'"),
        ("no/such.xml", None, "there is no file"),
        (3.5, None, "got float, wanted a name"),
        ({"type": "scene"}, None, "no sensor"),
        ({"type": "no-such"}, None, "cannot build the dictionary"),
        ("open-fog", (0, 4), "at least 1x1"),
        ("open-fog", (8.5, 4), "wanted \\(width, height\\)"),
        ("open-fog", 8, "wanted \\(width, height\\)"),
        ("open-fog", "8*4", "wanted WIDTHxHEIGHT"),
    ],
)
def test_what_is_no_scene_is_refused(scene, size, words, variant):
    with pytest.raises(airlight.InputError, match=words) as raised:
        airlight.load_scene(scene, size)
    assert "\n" not in str(raised.value)


def test_another_size_of_a_loaded_scene_is_refused_and_the_scene_stays_as_it_is(variant):
    scene = airlight.load_scene("open-fog", TINY)
    with pytest.raises(airlight.InputError, match="got 8x6 for a scene that is loaded already, at 16x12"):
        airlight.render(scene, size=(8, 6))
    assert scene.size == TINY


# Frames


def test_a_frame_is_that_of_the_parts_it_is_made_of(variant):
    from validation.configurations import configuration, prepared

    frame = airlight.render("sphere-spot", "shadow-planes", "quadrature-32", size=TINY, order="paper")
    scene = airlight.read_scene(airlight.load_scene("sphere-spot", TINY).scene)
    chosen = configuration("shadow-planes", "quadrature-32", {"order": "paper"})
    direct = airlight.render_frame(prepared(scene, chosen))
    np.testing.assert_array_equal(frame.airlight, direct.airlight)
    np.testing.assert_array_equal(frame.surface, direct.surface)
    np.testing.assert_array_equal(frame.depth, direct.distance)
    assert (frame.method, frame.kernel, dict(frame.parameters)) == (
        "shadow-planes",
        "quadrature-32",
        {"order": "paper"},
    )
    assert frame.plan["lights"] == "1 spot"
    assert frame.image.attributes["airlight:order"] == "paper"
    assert frame.times is None


def test_precision_decides_the_type(variant):
    single, double = (
        airlight.render("open-fog", "unshadowed", size=TINY, precision=one) for one in ("single", "double")
    )
    assert (single.airlight.dtype, double.airlight.dtype) == (np.float32, np.float64)
    np.testing.assert_allclose(single.airlight, double.airlight, rtol=1e-4)  # float32, beside the light
    assert np.any(single.airlight != double.airlight)


def test_what_a_frame_costs_where_it_is_asked_for(variant):
    times = airlight.render("open-fog", "unshadowed", "taylor", size=(8, 6), timed=True).times
    assert 0 < times.frame.low_ms <= times.frame.median_ms <= times.frame.high_ms


def test_a_function_of_ones_own_is_a_method(variant):
    usual = airlight.render("open-fog", "unshadowed", size=TINY)
    own = airlight.render("open-fog", brighter, size=TINY, times=3.0)
    np.testing.assert_allclose(own.airlight, 3 * usual.airlight, rtol=1e-6)
    assert own.label.endswith(":brighter (exact, times=3.0)")
    assert airlight.render("open-fog", own.method, size=TINY).kernel == "exact"
    with pytest.raises(airlight.InputError, match=r"test_api\.py, line \d+: ZeroDivisionError: nothing there"):
        airlight.render("open-fog", gone, size=TINY)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"method": "ray-marhc"}, "did you mean 'ray-march'"),
        ({"method": "unshadowed", "kernel": "exakt"}, "did you mean 'exact'"),
        ({"method": "ray-march", "kernel": "exact"}, "calls no kernel"),
        ({"method": "ray-march", "step": 3}, "did you mean 'steps'"),
        ({"method": "ray-march", "steps": 2.5}, "wanted a whole number"),
        ({"method": lambda view: 0}, "wanted a name or a function at the top of a module"),
        ({"method": 7}, "wanted a name or a function at the top of a module"),
        ({"precision": "half"}, "precision"),
        ({"method": "ray-march", "spacing": "random"}, "spacing"),
    ],
)
def test_what_cannot_be_rendered_is_refused(arguments, words, variant):
    with pytest.raises(airlight.InputError, match=words) as raised:
        airlight.render("open-fog", size=(8, 6), **arguments)
    assert "\n" not in str(raised.value)


# The truth


def test_the_truth_with_its_bound(variant):
    told = []
    scene = airlight.load_scene("sphere-spot", TINY)
    truth = airlight.reference(scene, progress=lambda share, what: told.append((share, what)))
    np.testing.assert_array_equal(truth.airlight, airlight.quadrature_reference(scene).layers["airlight"])
    assert truth.bound.shape == truth.airlight.shape == (12, 16, 3)
    assert truth.airlight.dtype == np.float64
    assert truth.standard_error is truth.surface_standard_error is None
    assert truth.relative_error == pytest.approx(float(truth.bound.mean() / truth.airlight.mean()))
    assert truth.details["left"] == 0
    assert told[-1] == (1.0, "quadrature")
    assert np.isfinite(truth.depth).any()


def test_a_truth_by_samples_with_its_standard_error(variant):
    traced = airlight.reference("open-fog", "single-scatter", size=TINY, samples=64, seed=7)
    truth = airlight.reference("open-fog", size=TINY)
    assert traced.bound is None
    assert traced.details["spp"] == 64
    assert traced.details["seeds"].startswith("7")
    assert 0 < traced.relative_error < 0.1
    compared = airlight.compare(traced, truth, margin=0.1)
    assert compared.statistics.equivalent
    assert compared.passed
    # Student's law for 32 batches: one of 576 values is beyond 8 standard errors with a probability of 3e-6.
    assert np.max(np.abs(traced.airlight - truth.airlight) / traced.standard_error) < 8


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"estimator": "quadratur"}, "did you mean 'quadrature'"),
        ({"samples": 64}, "samples: is for 'single-scatter'"),
        ({"estimator": "volpath", "pixel": "area"}, "traces pixel centres"),
        ({"estimator": "volpath", "samples": 64, "seconds": 1}, "samples and seconds exclude each other"),
        ({"estimator": "volpath", "samples": -1}, "samples: got -1"),
        ({"estimator": "volpath", "error": "small"}, "error: got 'small'"),
        ({"estimator": "volpath", "error": 0.1, "target": "best"}, "'pooled' or 'worst'"),
        ({"pixel": "corner"}, "'centre' or 'area'"),
    ],
)
def test_what_an_estimator_has_no_use_for_is_refused(arguments, words, variant):
    with pytest.raises(airlight.InputError, match=words):
        airlight.reference("open-fog", size=(8, 6), **arguments)


# Comparisons


def test_images_files_and_arrays_compare_alike(variant, tmp_path):
    truth = airlight.reference("sphere-spot", size=TINY)
    frame = airlight.render("sphere-spot", "ray-march", size=TINY, steps=16)
    one, two = truth.save(tmp_path / "truth.exr"), frame.save(tmp_path / "frame.exr")
    direct = airlight.compare(truth, frame)
    assert direct.metrics == airlight.error_metrics(truth.airlight, frame.airlight)
    assert airlight.compare(truth.airlight, frame.airlight).metrics == direct.metrics
    assert airlight.compare(truth, airlight.read_exr(two)).metrics == direct.metrics
    # A file keeps float32.
    files = airlight.compare(one, two)
    assert files.metrics.relative_rmse == pytest.approx(direct.metrics.relative_rmse, rel=1e-5)
    assert files.names == ("truth.exr", "frame.exr")
    total = airlight.compare(truth, frame, "total")
    assert total.metrics == airlight.error_metrics(truth.total, frame.total)
    mask = np.zeros((12, 16), bool)
    mask[4:8] = True
    assert airlight.compare(truth, frame, mask=mask).masked == 192 - 64
    assert airlight.compare(truth, frame, all_metrics=True).colour.ciede2000_mean > 0


@pytest.mark.parametrize(
    ("reference", "test", "options", "words"),
    [
        (np.ones((2, 2, 3)), np.ones((2, 3, 3)), {}, "two sizes"),
        (np.ones((2, 2, 3)), np.ones((2, 2, 3)), {"margin": 0.1}, "a margin wants standard errors"),
        (np.ones((2, 2, 3)), "no-such.exr", {}, "no-such.exr"),
        (np.ones((2, 2, 3)), object(), {}, "the test image: got object"),
        ([["a"]], np.ones((2, 2, 3)), {}, "the reference: got list"),
        (np.ones((2, 2, 3)), np.ones((2, 2, 3)), {"mask": np.ones((2, 2))}, "wanted truth values"),
    ],
)
def test_what_cannot_be_compared_is_refused(reference, test, options, words):
    with pytest.raises(airlight.InputError, match=words):
        airlight.compare(reference, test, **options)


# Integrals


def test_integrals_of_a_file_and_of_its_columns(data_folder, variant):
    path = data_folder / "airlight_integral.csv"
    found = airlight.integrate(path)
    assert found.summary["max"] < 4e-6  # the README's figure for the kernel `exact`
    assert found.J.shape == (2004,)
    cases = read_cases(path)
    columns = {name: getattr(cases, name) for name in ("phase", "g", "foot", "height", "x0", "x1", "sigma_t", "value")}
    again = airlight.integrate(columns)
    np.testing.assert_array_equal(again.J, found.J)
    np.testing.assert_array_equal(airlight.integrate(found.to_dict()).J, found.J)
    assert np.nanmax(np.abs(again.error)) == pytest.approx(found.summary["max"])
    assert "and 1992 more" in found._repr_html_()
    assert not found.J.flags.writeable


def test_integrals_of_rays_given_as_vectors(data_folder, variant):
    cases = read_cases(data_folder / "airlight_integral_rays.csv")
    named = ("phase", "g", "origin", "direction", "light", "x0", "x1", "sigma_t")
    found = airlight.integrate({name: getattr(cases, name) for name in named}, precision="double")
    np.testing.assert_array_equal(found.J, airlight.integrate(cases, precision="double").J)
    assert found.value is found.error is None


def test_integrals_have_the_shape_of_the_columns_and_a_certified_value(variant):
    foot, height = np.linspace(-1, 2, 5)[:, None], np.array([0.1, 0.7, 2.0])
    rays = {"phase": "hg", "g": 0.4, "foot": foot, "height": height, "x0": 0.0, "x1": np.inf, "sigma_t": 0.3}
    found = airlight.integrate(rays, "quadrature-32", precision="double", certify=True)
    assert found.J.shape == found.value.shape == found.error.shape == (5, 3)
    assert np.abs(found.error).max() < 1e-4
    assert np.asarray(found).shape == (5, 3)
    # One of them alone.
    alone = airlight.integrate(rays | {"foot": foot[3, 0], "height": 0.7}, "quadrature-32", precision="double")
    assert alone.J.shape == ()
    assert float(alone.J) == found.J[3, 1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sigma_t": -1.0}, "column 'sigma_t': -1.0 is out of range"),
        ({"foot": [1.0, 2.0], "height": [1.0, 2.0, 3.0]}, "shapes that do not go together"),
        ({"phase": "hgg"}, "did you mean 'hg'"),
        ({"x1": "far"}, "wanted an array of numbers"),
        ({"foot": np.nan}, "wanted a finite number"),
        ({"foot": []}, "the columns are empty"),
    ],
)
def test_what_is_no_case_is_refused(change, words, variant):
    rays = {"phase": "isotropic", "foot": 0.5, "height": 0.3, "x0": 0.0, "x1": 1.0, "sigma_t": 0.3}
    assert airlight.integrate(rays).J > 0
    with pytest.raises(airlight.InputError, match=words):
        airlight.integrate(rays | change)
    with pytest.raises(airlight.InputError, match=f"no column '{next(iter(change))}'"):
        airlight.integrate({name: value for name, value in rays.items() if name not in change})


@pytest.mark.parametrize("cases", [3, [1, 2]])
def test_what_has_no_columns_is_refused(cases):
    with pytest.raises(airlight.InputError, match="wanted columns by name"):
        airlight.integrate(cases)


# Studies


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


def test_bench_refuses_what_is_not_known_before_any_work(variant):
    with pytest.raises(airlight.InputError, match="did you mean 'unshadowed'"):
        airlight.bench("open-fog", "unshadow")
    with pytest.raises(airlight.InputError, match="did you mean 'open-fog'"):
        airlight.bench(["open-fog", "openfog"], "unshadowed", size=TINY)


def test_report_hands_on_what_it_was_given(variant, tmp_path, monkeypatch):
    given = {}

    def write(folder, **options):
        given.update(options, folder=folder)
        return {"claims": [{"text": "so"}], "scenes": [], "created": ""}

    monkeypatch.setattr("reports.report.write_report", write)
    found = airlight.report(tmp_path / "out", scenes=["open-fog"], methods=["min-max", brighter])
    assert found.folder == tmp_path / "out"
    assert found.claims == ("so",)
    assert given["scenes"] == ["open-fog"]
    assert given["effort"].name == "quick"
    assert [one.method.rpartition(":")[2] for one in given["configurations"]] == ["min-max", "brighter"]
    with pytest.raises(airlight.InputError, match="did you mean 'full'"):
        airlight.report(tmp_path, effort="ful")
    with pytest.raises(airlight.InputError, match="did you mean 'hall'"):
        airlight.report(tmp_path, scenes=["hal"])


@pytest.mark.slow
def test_a_report_from_python(variant, tmp_path):
    found = airlight.report(tmp_path / "out", scenes=["open-fog"], methods=["unshadowed", brighter])
    assert found.page.is_file()
    assert found.confirmed
    assert [one["method"].rpartition(":")[2] for one in found.data["scenes"][0]["methods"]] == [
        "unshadowed",
        "unshadowed",
        "unshadowed",
        "brighter",
    ]


def test_the_tutorial_runs(tmp_path):
    """Every snippet of docs/python.md, one after the other as in a notebook, prints what the page says."""
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
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
    for said, found in zip(expected, printed):
        words, numbers = _parts(said)
        assert _parts(found)[0] == words
        # Nothing here depends on the machine but rounding, and what samples and kernels make of it.
        np.testing.assert_allclose(_parts(found)[1], numbers, rtol=0.5, atol=2e-3)


def _parts(text):
    """Return a text without its numbers, and these."""
    pattern = r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?"
    return re.sub(pattern, "#", text), [float(one) for one in re.findall(pattern, text)]
