# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a cell becomes a row of finite numbers that are those of the metrics, or says
why; costly work asks first.
"""

import math
import weakref
from dataclasses import replace
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from airlight.errors import InputError
from airlight.realtime.frame.renderer import FrameRenderer
from airlight.realtime.memory import Memory
from airlight.realtime.methods.registry import FOG_METHODS
from airlight.realtime.methods.unshadowed import unshadowed
from airlight.realtime.scene.read_scene import SceneFeatures, read_scene
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import reference_of_pixels
from airlight.reports.commands.main import run as run_command
from airlight.validation.metrics.errors import error_metrics
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study import cost as expected_work
from airlight.validation.study import reference as sampled
from airlight.validation.study import run as module
from airlight.validation.study import variation
from airlight.validation.study.configuration import STANDARD, Configuration, configuration, prepared
from airlight.validation.study.cost import Work, check_work, frame_work, reference_work
from airlight.validation.study.reference import cell_reference, load_cell
from airlight.validation.study.row import row_values
from airlight.validation.study.run import run
from airlight.validation.study.scene import configurations_for, open_scene
from airlight.validation.study.stated_errors import EXACT
from airlight.validation.study.study import Cell, Checks, Measure, RandomScenes, Study
from airlight.validation.study.study_scene import check_reference
from tests.helpers.scenes import tiny_scene

SIZE = (24, 18)
MARCH = Configuration("ray-march", None, (("steps", 200),))


def scene_with(*, shadows=True, clear=False, area_lights=("disk",)):
    """Return of a scene what decides which configurations differ in it."""
    features = SceneFeatures(shadows=shadows, surfaces=True)
    return SimpleNamespace(
        features=features, medium=SimpleNamespace(clear=clear), area_lights=area_lights, lights=()
    )


USUAL, UNTIMED = Measure(), Measure("none")


def row_of(scene, chosen, measure=USUAL, medium=()):
    cell = Cell(scene, SIZE, medium, chosen, measure)
    loaded = load_cell(cell)
    return run(cell, read_scene(loaded.scene), cell_reference(loaded), whole=loaded.scene)


@pytest.mark.usefixtures("variant")
def test_a_row_has_the_errors_and_what_they_cost():
    chosen = configuration("shadow-planes")
    row, frame = row_of("sphere-spot", chosen)
    loaded = load_cell(Cell("sphere-spot", SIZE, (), chosen))
    assert row.error == error_metrics(cell_reference(loaded).airlight, frame.airlight)
    assert (row.status, row.reason, row.error.nonfinite) == ("done", None, 0)
    assert (row.stated.bound, row.stated.outside) == (EXACT, 0)
    assert row.reference.estimator == "quadrature"
    assert 0 < row.reference.error < 1e-6
    assert row.reference.crossings > 0
    assert row.times.frame.median_ms > 0 < row.cost.prepare_ms
    assert row.times.light_moved is None
    assert (row.times.frame.repetitions >= 1, row.cost.lights) == (True, 1)
    assert row.colour.ciede2000_max < 0.1
    assert (
        row.command
        == "airlight view sphere-spot --method shadow-planes --set kernel=exact --size 24x18"
    )
    assert row_values(row)["error.p99"] == row.error.p99


def test_an_error_of_the_reference_is_no_bias_of_runs_by_pixel():
    """Eight runs without a bias by a reference with random errors: these were called a bias."""
    random = np.random.default_rng(5)
    own = 2e-3 * random.normal(size=(12, 16, 3))
    runs = [1 + 0.01 * random.normal(size=own.shape) for _ in range(8)]

    def found(runs, error):
        none, spread = np.zeros(own.shape), np.full(own.shape, error)
        image = ReferenceImage(1 + own, none, none, none[..., 0], none[..., 0], 0, 0.0)
        image = replace(image, airlight_se=spread, surface_se=none)
        return module._runs_error(sampled.of_image(image), runs)

    exact, known = found(runs, 0.0), found(runs, 2e-3)
    assert exact.root_bias == pytest.approx(2e-3, rel=0.3)
    assert known.root_bias is None
    # The words on the bias hold for the true image, not for the reference alone.
    # Its pixels are drawn apart: the mean of 192 has less error than each by the root of that.
    scale = (1 + own).mean()
    assert known.bias_within - exact.bias_within == pytest.approx(2 * 2e-3 / scale / math.sqrt(192))
    assert known.most_bias - exact.most_bias == pytest.approx(2 * 2e-3 / scale)
    # A bias beyond that is found all the same; it had to be beyond three standard errors.
    for bias in (0.02, 5.5e-3):
        biased = found([run + bias for run in runs], 2e-3)
        assert biased.root_bias == pytest.approx(math.hypot(bias, 2e-3), rel=0.2)


@pytest.mark.parametrize("known", [False, True])
def test_an_error_of_the_reference_is_no_bias_of_a_method(variant, monkeypatch, known):
    """A reference with random errors of 1 %: an exact method was said to have them."""
    scene = mi.load_dict(tiny_scene(ball=None, size=(8, 6)))
    exact = variation.reference_image(scene)
    own = 0.01 * exact.airlight.mean()
    spread = np.full(exact.airlight.shape, own if known else 0.0)
    random = np.random.default_rng(5).normal(size=spread.shape)
    other = replace(
        exact, airlight=exact.airlight + own * random, airlight_se=spread, surface_se=spread
    )
    monkeypatch.setattr(variation, "reference_image", lambda scene: other)
    (found,) = variation.method_noise(scene, [configuration("shadow-planes")], runs=2)
    assert found.noise.relative_rmse == pytest.approx(0.01, rel=0.3)
    assert (found.noise.root_bias is None) == known
    # The picture shows bias alone: 95 of 100 pixels are within two standard errors.
    alike = np.mean(found.mean == found.reference)
    assert alike > 0.9 if known else alike < 0.1


@pytest.mark.usefixtures("variant")
def test_preparation_is_timed_when_what_was_prepared_before_is_gone(monkeypatch):
    """In `random:20` the maps of 35 lights take a gigabyte: two of these ended the worker."""
    alive = []

    def counted(scene, chosen):
        renderer = prepared(scene, chosen)

        def prepare(scene):
            assert not any(each() for each in alive)
            state = renderer.stages.prepare(scene)
            alive.append(weakref.ref(state[0]))
            return state

        stages = replace(renderer.stages, prepare=prepare)
        return replace(renderer, stages=stages)

    monkeypatch.setattr(module, "prepared", counted)
    row, _ = row_of("sphere-spot", configuration("soft-shafts"))
    assert len(alive) >= 2
    assert row.cost.prepare_ms > 0


@pytest.mark.usefixtures("variant")
def test_times_are_left_out_where_nobody_asks():
    row, _ = row_of(
        "open-fog", configuration("unshadowed"), Measure("none"), ("medium.sigma_t=0.3",)
    )
    assert (row.status, row.times, row.medium) == ("done", None, "medium.sigma_t=0.3")
    # nothing casts a shadow there, so the kernel's claim holds for whole rays
    assert row.stated.outside == 0
    assert row_of("windows", configuration("unshadowed"), Measure("none"))[0].stated is None


def speckled(view, *, kernel=None):
    """All of the airlight, times a random number of each ray from 0 to 2."""
    return 2 * view.uniform()[0] * unshadowed(view, kernel=kernel)


speckled.noisy = True


@pytest.mark.usefixtures("variant")
def test_a_row_of_a_noisy_method_has_the_errors_of_its_runs():
    row, _ = row_of("open-fog", configuration(speckled), UNTIMED)
    reference = cell_reference(
        load_cell(Cell("open-fog", SIZE, (), configuration("unshadowed")))
    ).airlight
    # A number even in [0, 2] has the variance 1/3.
    rmse = np.sqrt(np.mean(reference**2) / 3) / reference.mean()
    assert row.noise.runs == module.RUNS
    assert abs(row.noise.rmse - rmse) < 2 * row.noise.rmse_within
    assert abs(row.noise.bias) < 2 * row.noise.bias_within
    assert row.noise.root_bias is None
    assert row.noise.most_bias < 0.5 * rmse
    assert row_of("open-fog", configuration("unshadowed"), UNTIMED)[0].noise is None


@pytest.mark.claim("refusals-stand-in-the-report")
@pytest.mark.usefixtures("variant")
def test_a_refusal_is_a_row():
    """A refusal is a line of the table; one bad configuration must not end a report."""
    row, frame = row_of("windows", configuration("shadow-planes-2006", None, {"media": "paper"}))
    assert (row.status, frame, row.error, row.times) == ("refused", None, None, None)
    assert "lights with a place" in row.reason
    assert "\n" not in row.reason
    assert row.reference.mean > 0


def test_what_would_take_too_long_is_left_out_with_what_it_would_take(clock, monkeypatch):
    """16 x 12 pixels are four times 8 x 6: 0.15 s there, of which little is preparation,
    are at least 0.4 s here.
    """
    render = module.render_frame

    def slowed(renderer):
        clock.now += 0.15 if renderer.scene.camera.width == 8 else 0
        return render(renderer)

    monkeypatch.setattr(module, "_DOUBTFUL", -1.0)
    monkeypatch.setattr(module, "PROBE", (8, 6))
    monkeypatch.setattr(module, "render_frame", slowed)
    row = row_of("open-fog", MARCH, Measure("stages", 0.01, limit=0.3))[0]
    assert (row.status, row.error, row.times) == ("left out", None, None)
    assert "by a frame of 8 x 6 pixels" in row.reason
    assert "more than the limit of 0.3 s" in row.reason


def test_a_frame_is_judged_by_the_preparation_of_all_its_groups_of_lights(clock, monkeypatch):
    """Making the renderer takes no time, and a preparation a second."""
    prepare = FrameRenderer.prepare

    def slowed(renderer, scene):
        clock.now += 1
        return prepare(renderer, scene)

    monkeypatch.setattr(FrameRenderer, "prepare", slowed)
    groups = FrameRenderer.groups.func
    monkeypatch.setattr(FrameRenderer, "groups", property(lambda renderer: 2 * groups(renderer)))
    row = row_of("open-fog", MARCH, Measure("stages", 0.01, limit=0.5))[0]
    assert (row.status, row.error, row.times) == ("left out", None, None)
    assert "what a frame prepares takes 1 s, more than the limit of 0.5 s" in row.reason


@pytest.mark.usefixtures("variant")
def test_pixels_that_have_a_reference_keep_their_places_and_others_are_none(monkeypatch):
    def of_pixels(scene, pixels, plan):
        values = np.multiply.outer([pixels], [1.0, 2.0, 3.0])
        bound, spread, none = 0.5 * values, 0.1 * values, np.zeros(values.shape)
        return ReferenceImage(
            values, bound, none, none[..., 0], none[..., 0], 0, 0.0, airlight_se=spread
        )

    monkeypatch.setattr(sampled, "reference_of_pixels", of_pixels)
    some = sampled.sampled_reference(mi.load_dict(tiny_scene(size=(40, 32))))
    number = np.arange(40 * 32).reshape(32, 40)
    assert some.mask.sum() == 40 * 32 // 16
    expected = np.where(some.mask, number, 0)[..., None] * np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(some.airlight, expected)
    # three standard errors
    np.testing.assert_allclose(some.error, 0.5 * expected + 3 * 0.1 * expected)


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_under_an_area_light_a_sixteenth_of_the_pixels_has_a_reference(own_cache, monkeypatch):
    loaded = load_cell(Cell("penumbra-plane", (40, 32), (), configuration("unshadowed")))
    reference = cell_reference(loaded)
    assert reference.mask is not None
    assert int(reference.mask.sum()) == 40 * 32 // 16
    assert reference.surface is None
    again = cell_reference(loaded)
    assert (again.airlight == reference.airlight).all()
    assert again.spent == reference.spent
    finer = reference_of_pixels(loaded.scene, np.flatnonzero(reference.mask))
    assert finer.airlight_se is not None
    beyond = []
    for seed in range(16):
        monkeypatch.setattr(sampled, "_PLAN", replace(sampled._PLAN, seed=seed))
        some = sampled.sampled_reference(loaded.scene)
        difference = np.abs(some.airlight[reference.mask] - finer.airlight[0])
        beyond.append((difference > some.error[reference.mask] + 3 * finer.airlight_se[0]).mean())
    # The error is three standard errors of eight replicates, beyond which 2.0 % of Student's law
    # lie. The pixels of a run share their points, the runs do not: four standard errors of the mean
    # over runs.
    assert np.mean(beyond) <= 2 * stats.t.sf(3, 7) + 4 * np.std(beyond, ddof=1) / np.sqrt(
        len(beyond)
    )


def test_a_kernel_that_has_no_effect_is_refused_and_no_row_of_a_report(variant):
    """All kernels rendered one image of a scene of suns, in rows with the names of each."""
    scene = read_scene(load_scene("windows", SIZE).scene)
    useful = configurations_for(scene, STANDARD)
    assert {each.kernel for each in useful} == {None, "exact"}
    assert {"unshadowed", "shadow-planes", "light-volumes"} < {each.method for each in useful}
    with pytest.raises(InputError, match="got taylor, which has no effect where all lights are su"):
        prepared(scene, configuration("unshadowed", "taylor"))


def test_variants_of_shadows_are_left_out_where_nothing_casts_one():
    assert configurations_for(scene_with(clear=True), STANDARD) == STANDARD
    unbounded = configurations_for(scene_with(), STANDARD)
    (left_out,) = (configuration for configuration in STANDARD if configuration not in unbounded)
    assert dict(left_out.parameters) == {"order": "exact", "media": "paper"}
    without_points = configurations_for(scene_with(area_lights=()), STANDARD)
    assert set(unbounded) - set(without_points) == {
        given for given in STANDARD if "points" in dict(given.parameters)
    }
    left = configurations_for(scene_with(shadows=False), STANDARD)
    assert 0 < len(left) < len(STANDARD)
    assert all(
        not {"shadow", "map", "order"} & set(dict(configuration.parameters))
        for configuration in left
    )
    assert {configuration.method for configuration in left} == set(FOG_METHODS)
    # A method that somebody asks for alone was missing without a word.
    asked = (configuration("ray-march", None, {"shadow": "map"}),)
    assert configurations_for(scene_with(shadows=False), asked) == asked


def test_an_hour_and_the_memory_are_the_bounds(variant, monkeypatch):
    monkeypatch.setattr(expected_work.dr, "thread_count", lambda: 2)
    monkeypatch.setattr(expected_work, "usable_memory", lambda: Memory(10**9, "this machine has"))
    monkeypatch.setattr(expected_work.mi, "variant", lambda: "llvm_ad_rgb")
    # an hour if two threads are ten times as fast
    check_work("x", [Work(36000, 1e9), Work(36000, 1e9)])
    with pytest.raises(
        InputError,
        match=r"^x: would take about 10 hours at the speed of one machine, and more than an hour at 10 times that "
        r"speed; ask for less, or set AIRLIGHT_FORCE=1 to start it",
    ):
        check_work("x", [Work(37000), Work(36000)])
    with pytest.raises(
        InputError, match=r"^x: needs about 2 GB of memory, of which this machine has 1 GB; ask"
    ):
        check_work("x", [Work(1, 2e9)])
    with pytest.raises(InputError, match=r"about 63\.[0-9]* years at .* speed and needs"):
        check_work("x", [Work(4e9, 2e9)])
    assert check_work("x", []) == ()
    monkeypatch.setenv("AIRLIGHT_FORCE", "1")
    check_work("x", [Work(1e10, 2e9)])


def test_a_user_is_told_before_a_command_runs_for_minutes(variant, monkeypatch):
    """Means over pixels take 48 to 1360 rays beside the centre's, each with 32
    samples of every area light.
    """
    monkeypatch.setattr(expected_work.dr, "thread_count", lambda: 2)
    size, scale = (160, 120), 160 * 120 / 2
    assert check_work("x", [reference_work(size)]) == ()
    # A scene without a light is counted as one with a light.
    alone, two = (frame_work(size, lights=lights).seconds for lights in (1, 2))
    assert two == 2 * alone == 2 * frame_work(size, lights=0).seconds
    (words,) = check_work("x", [reference_work(size, pixel="area")])
    least, most = 49 * 100e-6 * scale, 1361 * 100e-6 * scale
    assert words.startswith(
        f"x: between {least:.2g} seconds and {most / 60:.2g} minutes by its rays and samples"
    )
    of_lights = reference_work(size, lights=0, area_lights=2, pixel="area")
    assert of_lights.seconds == pytest.approx(49 * (100e-6 + 2 * 32 * 10e-6) * 2 * scale)
    # A time without a range is one number.
    assert check_work("x", [Work(600.0)])[0].startswith("x: about 5 minutes by its rays")


@pytest.mark.parametrize(
    "command",
    [
        ["render", "open-fog", "--size", "16384x16384"],
        ["render", "open-fog", "--size", "800x600", "--set", "steps=10000000"],
        ["reference", "open-fog", "--estimator", "volpath", "--samples", "100000000000"],
        ["study", "methods", "open-fog", "--size", "16384x16384"],
    ],
    ids=" ".join,
)
def test_every_command_that_renders_asks(variant, tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(expected_work.dr, "thread_count", lambda: 2)
    monkeypatch.setattr(
        expected_work, "usable_memory", lambda: Memory(16 * 10**9, "this machine has")
    )
    assert run_command(command) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "set AIRLIGHT_FORCE=1 to start it" in err
    assert not list(tmp_path.iterdir())


TINY = Study("tiny", ("open-fog",), sizes=((16, 12),))
CHECKS = Checks((8, 6), {"volpath": 0.5}, {"volpath": 8})


@pytest.mark.slow
def test_without_patience_the_clock_decides_nothing(variant, own_cache, monkeypatch):
    """Two runs, one of them on a machine so busy that hours pass between two
    batches: the same samples.
    """

    def checked(**changes):
        study = replace(TINY, checks=replace(CHECKS, **changes))
        with open_scene("open-fog", study, {}).at(study.checks.size) as scene:
            return check_reference(scene, study.checks).value

    exact = {"margins": {"single-scatter": 0.01}, "samples": {"single-scatter": 8}}
    hours = iter(range(0, 10**9, 3600))
    quiet = checked(**exact)
    own_cache.rename(own_cache.with_name("other"))
    clock = SimpleNamespace(perf_counter=lambda: float(next(hours)), process_time=lambda: 0.0)
    monkeypatch.setattr("airlight.analytic.clock.time", clock)
    busy = checked(**exact)
    assert quiet
    assert busy == quiet
    impatient = checked(margins={"volpath": 1e-6}, patience=1.0)
    assert not any(verdict.finished for verdict in impatient.values())


def test_a_scene_of_half_has_half_the_width_in_all_its_images_and_more_paths_in_a_batch():
    checks = Checks(size=(48, 36), samples={"single-scatter": 128, "volpath": 16})
    study = Study(
        "s",
        ("a", "b"),
        half=("b",),
        sizes=((40, 30),),
        measure=Measure(timed_size=(640, 480)),
        checks=checks,
    )
    assert study.of("a") == study
    halved = study.of("b")
    assert (halved.sizes, halved.measure.timed_size, halved.checks.size) == (
        ((20, 15),),
        study.timed_size,
        (24, 18),
    )
    assert halved.checks.samples == {"single-scatter": 128, "volpath": 64}
    # Half of one pixel is one: there was an image without pixels.
    assert replace(study, sizes=((1, 3),)).of("b").sizes == ((1, 1),)


def test_images_of_a_study_are_each_scene_size_and_medium_and_the_first_are_timed():
    chosen = (configuration("unshadowed"), configuration("shadow-planes"))
    study = Study(
        "s",
        ("a", "random:4"),
        random=RandomScenes(count=3, first=3),
        sizes=((8, 6), (16, 12)),
        media=((), ("sigma_t=2",)),
        configurations=chosen,
        measure=Measure(times="alone"),
        timed=2,
    )
    assert list(study.scene_names()) == ["a", "random:3", "random:4", "random:5"]
    assert (study.scene_count, study.cells_by_scene) == (4, 8)
    images = list(study.images())
    assert len(images) == 4 * 2 * 2
    assert [cell.chosen for cell in images[0]] == list(chosen)
    assert [(image[0].scene, image[0].size, image[0].medium) for image in images[:3]] == [
        ("a", (8, 6), ()),
        ("a", (8, 6), ("sigma_t=2",)),
        ("a", (16, 12), ()),
    ]
    assert list(study.timed_images()) == images[: 2 * 4]
    assert list(replace(study, timed=None).timed_images()) == images
    assert not list(replace(study, measure=Measure(times="with")).timed_images())
    assert images[0][0].image == images[0][1].image  # which share a reference
