# SPDX-License-Identifier: BSD-3-Clause
"""Claim: advice names the fastest method that holds an error, and promises no more than it was judged to keep.

The rows here are made by known laws with known noise: what the regression should find is known.
"""

import json

import numpy as np
import pytest

from analytic.errors import InputError
from validation.advise.choose import Candidate, choose, predicted
from validation.advise.features import FEATURES, features
from validation.advise.fit import fit_and_judge, fit_rows, main
from validation.advise.judge import held_out_choices, judged
from validation.advise.model import read_model, write_model
from validation.advise.regression import _ridge, fit_regression
from validation.advise.rows import SceneRow, read_rows
from validation.configurations.methods import Configuration

EXACT = Configuration("shadow-planes", "exact")
COARSE = Configuration("ray-march", None, (("steps", 16),))
FINE = Configuration("ray-march", None, (("steps", 256),))


def _properties(generator):
    values = {name: float(generator.uniform(0.1, 3.0)) for name in FEATURES}
    return values | {
        "shadow_edges": float(10 ** generator.uniform(-2, 1)),
        "silhouettes": float(10 ** generator.uniform(0, 4)),
        "pixels": 19200.0,
    }


def _rows(count, noise, seed=5):
    """Return rows: marching errs by edges over steps, planes cost by silhouettes."""
    generator = np.random.default_rng(seed)
    rows = []
    for number in range(count):
        properties = _properties(generator)
        image = f"random:{number}", "", 160, 120

        def random():
            return 10 ** generator.normal(0, noise)

        edges, silhouettes = properties["shadow_edges"], properties["silhouettes"]
        for chosen, steps in ((COARSE, 16), (FINE, 256)):
            error = 0.1 * (edges + 0.01) / steps * random()
            rows.append(SceneRow(image, chosen, properties, False, error, 0.19 * steps * random()))
        if number % 10 == 0:
            rows.append(SceneRow(image, EXACT, properties, True))
        else:
            cost = 0.7 * (silhouettes + 1) ** 0.5 * random()
            rows.append(SceneRow(image, EXACT, properties, False, 1e-6 * random(), cost))
    return rows


def test_a_regression_finds_a_law_and_how_far_off_it_is():
    generator = np.random.default_rng(3)
    numbers = generator.normal(size=(3000, len(FEATURES)))
    values = 2.0 + 0.5 * numbers[:, 3] - 1.5 * numbers[:, 7] + generator.normal(0, 0.1, 3000)
    regression = fit_regression(numbers, values)
    slopes = regression.coefficients / regression.spread
    assert slopes[3] == pytest.approx(0.5, abs=0.03)
    assert slopes[7] == pytest.approx(-1.5, abs=0.03)
    others = generator.normal(size=(2000, len(FEATURES)))
    truth = 2.0 + 0.5 * others[:, 3] - 1.5 * others[:, 7] + generator.normal(0, 0.1, 2000)
    predictions = [regression.predict(row) for row in others]
    for share in (0.5, 0.9, 0.99):
        # Of sixty such sets of scenes none was further off than 0.031.
        below = np.array([each.below(share) for each in predictions])
        assert np.mean(truth <= below) == pytest.approx(share, abs=0.04)
    assert predictions[0].covered(0.99) == pytest.approx(0.99, abs=0.005)


def test_a_regression_finds_which_scenes_are_hard():
    """Noise that is thirty times as large in one scene as in another: each has its own share below."""
    generator = np.random.default_rng(8)
    hardness = generator.uniform(0, 1.5, 4000)
    values = 2.0 + generator.normal(0, 1, 4000) * 10**hardness
    regression = fit_regression(hardness[:3000, None], values[:3000])
    for low in (0.0, 0.5, 1.0):
        those = [number for number in range(3000, 4000) if low < hardness[number] < low + 0.5]
        below = [values[number] <= regression.predict(hardness[number, None]).below(0.9) for number in those]
        # Six other seeds are within 0.063, and with one scale for all up to 0.2 off.
        assert np.mean(below) == pytest.approx(0.9, abs=0.07)


def test_left_out_residuals_are_those_of_fits_without_the_scene():
    generator = np.random.default_rng(4)
    numbers, values = generator.normal(size=(40, 3)), generator.normal(size=40)
    standard = (numbers - numbers.mean(axis=0)) / numbers.std(axis=0)
    regression = _ridge(standard, values)
    left_out = []
    centred = values - regression.constant
    for number in range(40):
        others = np.arange(40) != number
        matrix = np.vstack([np.ones(39), standard[others].T]) @ np.column_stack([np.ones(39), standard[others]])
        matrix[1:, 1:] += regression.penalty * np.eye(3)
        right = np.vstack([np.ones(39), standard[others].T]) @ centred[others]
        constant, *slopes = np.linalg.solve(matrix, right)
        left_out.append(centred[number] - constant - standard[number] @ slopes)
    np.testing.assert_allclose(left_out, regression.residuals, atol=1e-10)


def test_few_scenes_say_what_they_cover():
    regression = fit_regression(np.arange(9.0)[:, None], np.array([0, 1, 0, 2, 0, 1, 3, 0, 1.0]))
    prediction = regression.predict(np.array([4.0]))
    assert prediction.below(0.99) == prediction.value + prediction.scale * regression.scores[-1]
    assert prediction.covered(0.99) == pytest.approx(0.9)
    assert prediction.covered(0.5) == pytest.approx(0.5)


def test_features_beyond_the_sweep_are_held_and_named():
    numbers = np.random.default_rng(1).uniform(0, 1, (50, 2))
    regression = fit_regression(numbers, numbers[:, 0])
    far = np.array([1e6, 0.5])
    assert regression.beyond(far).tolist() == [True, False]
    assert regression.predict(far).value < 3


@pytest.mark.claim("advise-choice", tolerance="in 120 made scenes: 97 % of promises held (three standard deviations)")
def test_choices_hold_and_are_fast_in_scenes_that_were_not_seen():
    model, judgement = fit_and_judge(_rows(120, 0.03), {})
    assert len(model.configurations) == 3
    assert judgement.scenes == 120
    assert judgement.held >= 0.97
    assert judgement.close >= 0.9
    assert judgement.promised > 0.9
    assert model.about["margin"] == judgement.margin


def test_a_judge_sees_a_model_that_knows_nothing():
    """Models of shuffled errors promise what they cannot keep, or nothing: the judge must not praise them."""
    rows = _rows(80, 0.03)
    generator = np.random.default_rng(9)
    errors = generator.permutation([row.error for row in rows if not row.refused]).tolist()
    mixed = [row if row.refused else SceneRow(**(vars(row) | {"error": errors.pop()})) for row in rows]
    choices = held_out_choices(rows, lambda _: fit_rows(mixed), 0.0)
    judgement = judged(choices, 0.0)
    # With five other seeds 0.60 to 0.71 were close, and 0.97 to 0.98 of the choices of a model that knows the errors.
    assert judgement.promised < 0.1
    assert judgement.close < 0.8


def test_the_cheapest_that_holds_is_taken():
    def candidate(chosen, bound, chance, cost, refused=""):
        return Candidate(chosen, bound / 3, bound, 0.99, chance, cost, cost, cost, refused)

    cheap, dear = candidate(COARSE, 5e-3, 0.1, 1.0), candidate(FINE, 5e-4, 0.7, 9.0)
    refuses = candidate(EXACT, 1e-6, 1.0, 0.1, "it has no triangles")
    assert choose([cheap, dear, refuses], 1e-3) == (dear, True)
    assert choose([cheap, dear, refuses], 1e-2) == (cheap, True)
    assert choose([cheap, dear, refuses], 1e-5) == (dear, False)  # the likelier
    assert choose([cheap, dear, candidate(COARSE, 6e-4, 0.7, 8.0)], 1e-5) == (candidate(COARSE, 6e-4, 0.7, 8.0), False)
    assert choose([refuses], 1e-3) == (None, False)
    nearly, hardly = candidate(COARSE, 6e-4, 0.6, 7.0), candidate(COARSE, 6e-4, 0.6, 8.0)
    assert choose([cheap, dear, nearly], 1e-5) == (nearly, False)  # 7 / 0.6 is less than 9 / 0.7
    assert choose([cheap, dear, hardly], 1e-5) == (dear, False)  # 8 / 0.6 is not, and nor is 1 / 0.1 likely enough
    hopeless = [candidate(FINE, 1e-2, 0.0, 9.0), candidate(COARSE, 1e-1, 0.0, 8.0)]
    assert choose(hopeless, 1e-5) == (hopeless[1], False)


def test_cost_is_in_proportion_to_pixels():
    (each, *_) = fit_rows(_rows(30, 0.03)).configurations
    properties = _rows(1, 0.0)[0].properties
    small, large = (predicted(each, properties | {"pixels": n}, 1e-3, share=0.9) for n in (19200.0, 192000.0))
    assert large.cost_ms == pytest.approx(10 * small.cost_ms)
    assert large.error == small.error


def test_a_model_survives_its_file(tmp_path):
    model = fit_rows(_rows(30, 0.03), {"scenes": 30, "margin": 0.1})
    path = tmp_path / "model.json"
    write_model(model, path)
    again = read_model(path)
    assert again.about == model.about
    properties = _rows(1, 0.0)[0].properties
    for one, other in zip(model.configurations, again.configurations, strict=True):
        assert one.chosen == other.chosen
        first, second = (predicted(each, properties, 1e-3, share=0.99) for each in (one, other))
        assert second.error_bound == pytest.approx(first.error_bound, rel=1e-3)
        assert second.cost_ms == pytest.approx(first.cost_ms, rel=1e-3)
        assert second.chance == pytest.approx(first.chance, abs=2 / 30)


def test_the_chance_is_the_share_of_left_out_residuals():
    (each, *_) = fit_rows(_rows(80, 0.03)).configurations
    properties = _rows(1, 0.0)[0].properties
    found = predicted(each, properties, 1e-3, share=0.9)
    # At the error that nine of ten scenes stay below, nine of ten do.
    again = predicted(each, properties, found.error_bound * (1 + 1e-9), share=0.9)
    assert again.chance == pytest.approx(found.covered, abs=1 / 80)  # a scene
    assert predicted(each, properties, 1e-12, share=0.9).chance == 0


def test_a_file_of_another_version_is_refused(tmp_path):
    path = tmp_path / "model.json"
    with pytest.raises(InputError, match="cannot read"):
        read_model(path)
    path.write_text(json.dumps({"format": 2, "features": ["lights"]}))
    with pytest.raises(InputError, match="of another version; fit it again by airlight advise --fit"):
        read_model(path)


def test_a_property_that_is_missing_is_named():
    properties = dict(_rows(1, 0.0)[0].properties)
    del properties["triangles"]
    with pytest.raises(InputError, match="property triangles: got None"):
        features(properties)


def _parquet(path, rows):
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = [
        {
            "scene": row.image[0],
            "medium": None,
            "width": 160,
            "height": 120,
            "method": row.chosen.method,
            "kernel": row.chosen.kernel,
            "parameters": json.dumps(dict(row.chosen.parameters)),
            "status": "refused" if row.refused else "done",
            "relative_rmse": None if row.refused else row.error,
            "frame_ms": None if row.refused else row.cost,
            "device": "a machine",
            **{f"property.{name}": value for name, value in row.properties.items()},
        }
        for row in rows
    ]
    pq.write_table(pa.Table.from_pylist(table), path)


def test_one_command_fits_the_rows_of_a_sweep(tmp_path, capsys):
    pytest.importorskip("pyarrow", reason="sweeps are an extra")
    _parquet(tmp_path / "sweep.parquet", _rows(40, 0.03))
    rows, made = read_rows([tmp_path])
    assert len(rows) == 120
    assert sum(row.refused for row in rows) == 4
    assert made["device"] == ["a machine"]
    assert main([str(tmp_path), "-o", str(tmp_path / "model.json")]) == 0
    assert "40 scenes, each held out once, 200 choices" in capsys.readouterr().out
    assert read_model(tmp_path / "model.json").about["scenes"] == 40
    with pytest.raises(InputError, match="lacks the column frame_cpu_ms"):
        read_rows([tmp_path], "frame_cpu_ms")
    assert main([str(tmp_path / "none.parquet")]) == 2


def test_too_few_scenes_are_refused():
    with pytest.raises(InputError, match="no configuration was done in 6 scenes or more"):
        fit_and_judge(_rows(5, 0.03), {})
