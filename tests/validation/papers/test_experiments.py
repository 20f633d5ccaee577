# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the experiments behind the claims of papers measure what they say, by hand where a hand can."""

import numpy as np
import pytest

from realtime.scene.read_scene import read_scene
from tests.validation.papers.test_claims import JUDGED, key, measured
from validation.clock import Timing
from validation.papers import billeter_tables, biri_tables, soft_shafts
from validation.papers.biri_tables import STAGES, fractions
from validation.papers.claims import claims, experiments, taken, verdict
from validation.papers.formulas import _annex, _cloud_equations, _droplets
from validation.papers.scattering import fitted_constant, left_over
from validation.papers.shadow_planes import drawn
from validation.scenes.loading import load_scene


def test_a_stencil_of_one_ray_by_hand():
    """Two shadows that overlap, [0.2, 0.5] and [0.4, 0.7]: lit are 0.2 before and 0.3 behind them."""
    shadows = [(0.2, 0.5), (0.4, 0.7)]
    # Back to front by 5.1.5: 1, less 0.7, then 0.5 is not drawn, 0.4 neither, and 0.2 more: 1 - 0.7 + 0.2.
    assert drawn(shadows, -1) == pytest.approx(0.5)
    # By section 5, stage 5: less 0.7, then the stencil is below 0 for good, and 0.2 is not added.
    assert drawn(shadows, 1) == pytest.approx(0.3)


def test_printed_formulas_by_hand():
    annex = _annex()
    # Printed a^2 - a for (a^2 - a)/2: of the largest derived value it has twice, wherever that is.
    assert annex["isotropic c2"] == pytest.approx(2)
    assert annex["isotropic c0"] == 1
    # The mean of ((1 + c)/2)^n over the sphere is 1/(n + 1).
    assert (annex["hazy mean"], annex["murky mean"]) == (pytest.approx(1 + 9 / 9), pytest.approx(1 + 50 / 33))
    clouds = _cloud_equations()
    assert clouds["eq. 2"] == pytest.approx(-1)  # the sign of the integral of exp(-kappa x)
    # With s = (l1 - l0)/(x1 - x0) the true integral is the printed one over -(1 + s).
    assert clouds["eq. 1"] == pytest.approx(-(1 + (4.0 - 11.0) / (19.0 - 3.0)))
    light = _droplets()
    assert light["peak"] + light["lobe"] == pytest.approx(light["forward"])


def test_fractions_of_stages_have_intervals():
    """Five works of 1, 2, 3, 5 and 13 ms, each 10 % sure: planes take 13 - 3, sorting 5 - 1 ms of 20."""
    times = [Timing(ms, 0.9 * ms, 1.1 * ms, 5) for ms in (1.0, 2.0, 3.0, 5.0, 13.0)]
    found = fractions(times)
    assert [found[name][0] for name in STAGES] == pytest.approx([100 * ms / 20 for ms in (1, 2, 3, 4, 10)])
    low, high = found["planes"][1:]
    assert low == pytest.approx(100 * 8.4 / (8.4 + 1.1 + 2.2 + 3.3 + (5.5 - 0.9)))
    assert high == pytest.approx(100 * 11.6 / (11.6 + 0.9 + 1.8 + 2.7 + (4.5 - 1.1)))
    assert found["main cost"][0] == pytest.approx(2.5)


def test_the_penumbra_leaves_out_what_sees_all_of_the_light(variant):
    """Fractions are of the same points with and without occluders: where no bar stands between, they are 1 exactly."""
    scene = read_scene(load_scene("fence", (40, 32)).scene)
    found = soft_shafts.penumbra(scene)
    assert 5 < found.sum() < 0.3 * found.size


def test_what_a_constant_leaves_of_two_noisy_images():
    random = np.random.default_rng(1)
    fog = random.uniform(1, 2, 100_000)
    first, second = (3 * fog + random.normal(size=fog.size) for _ in range(2))
    constant = fitted_constant(fog, (first + second) / 2)
    assert constant == pytest.approx(3, rel=0.01)
    assert left_over(first, second, 2 * fog) == pytest.approx(1 / 3, rel=0.02)  # a third of the light is left
    assert left_over(first, second, 3 * fog) < 0.03  # the noise is not counted


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, each in experiments().items() if each.effort in ("quick", "default")])
def test_experiments_have_the_recorded_verdicts(variant, name):
    """Verdicts on the machine or on our scenes are not compared: they are those of the machine at hand."""
    figures = experiments()[name].run()
    for each in JUDGED:
        if each.experiment == name:
            figure = taken(each, figures)
            assert not isinstance(figure, str), figure
            if not each.ours:
                assert verdict(each, figure) == verdict(each, measured(each)), key(each)


def asked(name):
    """Return the names of the figures that claims take from an experiment."""
    return {part for each in claims() if each.experiment == name for part in each.figure.split(" / ")}


@pytest.mark.slow
def test_small_tables_have_every_figure_that_claims_ask_for(variant, monkeypatch):
    """Tables take minutes at the published sizes; here each is as small as it can be, and no rate is looked at."""
    assert asked("biri tables") <= set(biri_tables.biri_tables(scale=0.04, seconds=0.0))
    assert asked("soft shafts") <= set(soft_shafts.soft_shafts((40, 32), seconds=0.0))
    monkeypatch.setattr(billeter_tables, "_SECONDS", 0.0)
    small = billeter_tables.billeter_tables((16, 12), maps=(16, 32, 64))
    maps = {"16": "1024", "32": "2048", "64": "4096"}
    found = {" ".join(maps.get(word, word) for word in name.split()) for name in small}
    assert asked("billeter tables") <= found
    assert small["colonnade 32 triangles"] == 2 * 32**2 + 4 * 32  # the texels, and the sides up to the light
