# SPDX-License-Identifier: BSD-3-Clause
"""The certified rows for lights with extent are what the generator gives, and what the truth computes."""

import json

import numpy as np
import pytest

from analytic.phase import PhaseFunction
from reference.quadrature.unbounded import Terms, Unbounded, lit_stretches, profile_of
from reference.scene.read import TruthLight, TruthMedium
from reference.visibility.certificate import LitIntervals
from reference.visibility.planes import Rays, cone_interval
from tests.evidence.certified import area_lights
from tests.evidence.closed_forms import sphere_airlight


@pytest.fixture(scope="module")
def certified(data_folder):
    return json.loads((data_folder / "certified_area_lights.json").read_text())


def test_rows_are_those_of_the_generator(certified):
    assert certified["schema"] == area_lights.SCHEMA
    for rows, inputs in ((certified["points"], area_lights.POINTS), (certified["spheres"], area_lights.SPHERES)):
        assert [tuple(list(row.values())[:-1]) for row in rows] == list(inputs)
    assert area_lights._text(area_lights.point_integral(*area_lights.POINTS[0])) == certified["points"][0]["J"]


@pytest.mark.slow
def test_all_rows_again(certified):
    assert area_lights.certified_rows() == json.loads(json.dumps(certified))


@pytest.mark.claim("area-light-certified", tolerance="1e-10 relative: Gauss-Kronrod's own")
@pytest.mark.parametrize("number", range(len(area_lights.POINTS)))
def test_the_truth_of_one_point(certified, number):
    row = certified["points"][number]
    phase = PhaseFunction("isotropic") if row["g"] is None else PhaseFunction("hg", g=row["g"])
    medium = TruthMedium(np.full(3, row["sigma_t"]), np.ones(3), phase, None)
    # In the plane of ray and light; what the normal has across the plane does not matter.
    beside = np.sqrt(max(0.0, 1 - row["axial"] ** 2 - row["across"] ** 2))
    quarter = 0.5 * np.pi
    normal = np.array([beside, row["across"], row["axial"]])
    light = TruthLight(np.zeros(3), np.ones(3), normal, cutoff=quarter, beam=quarter, cosine=True)
    place, along, across = np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.array([[0.0, 1, 0]])
    origin = row["height"] * across[0] - row["foot"] * along[0]
    rays = Rays(origin, along, place, across, np.array([row["foot"]]), np.array([row["height"]]))
    low, high = (rays.distance(end) for end in cone_interval(rays, light, light.cutoff))
    lit = LitIntervals(np.array([0]), np.maximum(row["x0"], low), np.minimum(row["x1"], high), edge=0.0)
    stretches, profile = lit_stretches(light, rays, lit), profile_of(light, rays)
    value, bound = Unbounded(medium).sums(rays, stretches, np.array([np.inf]), Terms(profile))
    expected = float(row["J"]) * row["sigma_t"] / (4 * np.pi)
    assert value[0] == pytest.approx(expected, rel=1e-10)
    assert abs(value[0, 0] - expected) <= bound[0, 0]


@pytest.mark.parametrize("number", range(len(area_lights.SPHERES)))
def test_the_closed_form_of_a_sphere(certified, number):
    row = dict(certified["spheres"][number])
    expected = float(row.pop("K"))
    value = sphere_airlight(row.pop("sigma_t"), row.pop("height"), row.pop("radius"), **row)
    assert value == pytest.approx(expected, rel=1e-12)
