# SPDX-License-Identifier: BSD-3-Clause
"""What a sweep claims: shares of scenes with their intervals, what goes with error, what was refused, what is wrong."""

import numpy as np
import pytest

from reports.sweep.claims import claim
from reports.sweep.correlations import correlations, strongest, sure
from reports.sweep.faults import checks, faults, reasons
from reports.sweep.read import FILE, read_sweep
from reports.sweep.samples import samples
from tests.helpers.sweeps import row, rows, write_rows
from validation.statistics.samples import binomial_interval


@pytest.fixture
def sweep_of(tmp_path):
    return lambda several: read_sweep(write_rows(tmp_path / FILE, several))


@pytest.mark.claim("sweep-intervals")
def test_share_of_the_scenes_and_its_interval(sweep_of):
    several = [row(f"random:{n}", relative_rmse=2e-3 if n < 8 else 5e-4) for n in range(1000)]
    (sample,) = samples(sweep_of(several))
    made = claim(sample, 1e-3)
    assert (made.tries, made.within, made.undecided, made.fraction) == (1000, 992, 0, 0.992)
    assert (made.low, made.high) == binomial_interval(992, 1000)
    assert made.text == "ray-march: within 1e-3 in 99.2 % of 1000 scenes, 98.4 to 99.7 %."


@pytest.mark.claim("sweep-tries")
def test_what_is_no_number_misses_and_a_refusal_is_no_try(sweep_of):
    several = [
        row("random:0", relative_rmse=1e-5),
        row("random:1", relative_rmse=1e-5, nonfinite=1),
        row("random:2", status="failed", reason="x"),
        row("random:3", status="refused", reason="x"),
        row("random:4", relative_rmse=None, rmse=None, nonfinite=19200),
    ]
    made = claim(samples(sweep_of(several))[0], 1e-3)
    assert (made.tries, made.within, made.refused) == (4, 1, 1)
    assert made.text.endswith("; 1 more refused.")


@pytest.mark.claim("sweep-tries")
def test_scene_without_a_reference_is_no_try(sweep_of):
    several = [
        row("random:0", relative_rmse=1e-5),
        row("random:1", status="hung", reason="reference of random:1 160x120: stopped after 600 s"),
        row("random:2", status="hung", reason="stopped after 600 s"),
        row("random:3", status="hung", reason="reference of random:3 160x120: stopped after 600 s"),
        row("random:3", medium="m", relative_rmse=1e-5),
    ]
    made = claim(samples(sweep_of(several))[0], 1e-3)
    assert (made.tries, made.within, made.untold) == (3, 2, 1)
    assert made.text.endswith("; no reference of 1 more.")


@pytest.mark.claim("sweep-tries")
def test_what_the_reference_cannot_tell_widens_the_interval_on_one_side(sweep_of):
    several = [row(f"random:{n}", relative_rmse=1e-4) for n in range(10)]
    several += [
        row("random:10", relative_rmse=9e-4, reference_error=2e-4),
        row("random:11", relative_rmse=1.1e-3, reference_error=2e-4),
        row("random:12", relative_rmse=5e-3, reference_error=2e-4),
    ]
    made = claim(samples(sweep_of(several))[0], 1e-3)
    assert (made.tries, made.within, made.undecided) == (13, 10, 2)
    assert made.low == binomial_interval(10, 13)[0]
    assert made.high == binomial_interval(12, 13)[1]
    assert made.text.endswith("the reference is not exact enough to tell in 2 scenes.")


@pytest.mark.claim("sweep-properties")
def test_planted_property_is_found_and_no_other(sweep_of):
    sweep = sweep_of(rows(200))
    made = samples(sweep)
    found = correlations(sweep, made)
    assert len(found) == 5 * 5
    for sample in made:
        chosen = strongest(found, sweep, sample)
        assert [each.property for each in chosen] == (["optical_depth"] if sample.method == "ray-march" else [])
    march = next(sample for sample in made if sample.method == "ray-march")
    (depth,) = strongest(found, sweep, march)
    assert 0.9 < depth.low < depth.r < depth.high


@pytest.mark.claim("sweep-properties")
def test_of_properties_that_say_the_same_the_strongest_is_named(sweep_of):
    rng = np.random.default_rng(2)
    several = []
    for number in range(80):
        lights, near = float(rng.integers(1, 9)), rng.uniform(0.1, 5)
        silhouettes = 100 * lights * np.exp(0.2 * rng.normal())
        error = 1e-3 * silhouettes / near
        several.append(
            row(
                f"random:{number}",
                relative_rmse=error,
                property_lights=lights,
                property_silhouettes=silhouettes,
                property_nearest_light=near,
                property_constant=2.0,
            )
        )
    sweep = sweep_of(several)
    (sample,) = samples(sweep)
    found = correlations(sweep, [sample])
    assert {each.property for each in found} == {"lights", "silhouettes", "nearest_light"}
    chosen = strongest(found, sweep, sample)
    assert {each.property: each.r > 0 for each in chosen} == {"silhouettes": True, "nearest_light": False}


@pytest.mark.claim("sweep-properties")
def test_intervals_hold_together(sweep_of):
    """Of 100 properties of noise none is sure in most sweeps; each by itself at 95 % would give five."""
    rng = np.random.default_rng(4)
    noise = [
        {f"property_p{k}": value for k, value in enumerate(rng.normal(size=100))} | {"relative_rmse": rng.lognormal()}
        for _ in range(60)
    ]
    sweep = sweep_of([row(f"random:{n}", **values) for n, values in enumerate(noise)])
    found = correlations(sweep, samples(sweep))
    assert len(found) == 100
    assert not any(sure(each) for each in found)
    assert any(abs(each.r) > 0.2 for each in found)


@pytest.mark.claim("sweep-faults")
def test_refusals_are_counted_by_reason(sweep_of):
    several = rows(60)
    refused = [each for each in several if each["status"] == "refused"]
    several.append(row("hall", status="hung", reason="longer than 60 s"))
    (refusal, hung) = reasons(sweep_of(several))
    assert refusal.reason == "SCENE has N lights, wanted at most N"
    assert (refusal.cells, refusal.scenes) == (len(refused), len(refused))
    assert refusal.labels == ("light-volumes (exact)",)
    assert refusal.example == refused[0]["command"]
    assert (hung.status, hung.reason, hung.cells) == ("hung", "longer than N s", 1)


@pytest.mark.claim("sweep-faults")
def test_planted_faults_are_found_and_counted(sweep_of):
    several = rows(20)
    several[7] |= {"error.nonfinite": 12}
    several[8] |= {"error.negative": 5}
    several[13] |= {"stated.outside": 2, "stated.bound": 1e-5}
    several[3] |= {"stated.outside": 0, "stated.bound": 1e-5}
    sweep = sweep_of(several)
    found = faults(sweep)
    assert [(each.check, each.scene, each.pixels, each.of) for each in found] == [
        ("not finite", several[7]["scene"], 12, 19200),
        ("negative", several[8]["scene"], 5, 19200),
        ("outside of the bound", several[13]["scene"], 2, 19200),
    ]
    counted = {each.check: each for each in checks(sweep)}
    assert counted["outside of the bound"].rows == 2
    assert counted["outside of the bound"].faulty_scenes == 1
    assert counted["surface not finite"].rows == 0
    assert counted["negative"].rows == sum(each["status"] == "done" for each in several)
