# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `quadrature`, `single-scatter` and `volpath` share no derivation, so that their agreement is evidence.

The imports of each are followed to their end. What two of them reach is listed here with the reason why it is no
derivation of the airlight; whoever makes them share more must say so in this list.
"""

from itertools import combinations

import pytest

from tests.helpers.imports import import_graph, imported, inside, modules, reached

ESTIMATORS = {
    "quadrature": "reference.quadrature",
    "single-scatter": "reference.monte_carlo.single_scatter",
    "volpath": "reference.monte_carlo.volpath",
}
READING = {
    "analytic.droplets": "phase functions of droplets, by their names; no scene has these names",
    "analytic.mie": "the same",
    "analytic.errors": "words for the user",
    "analytic.phase": "the scene's record names the phase function; the two Monte Carlo estimators ask Mitsuba's",
    "reference.scene.camera": "the rays through the pixel centres: where one looks, no light",
    "reference.scene.convex_bounds": "which shapes may bound a medium; where rays cross them is in `visibility`",
    "reference.scene.area_light": "shape, place and radiance as Mitsuba gives them",
    "reference.scene.directional_light": "direction and irradiance as Mitsuba gives them",
    "reference.scene.read": "coefficients, lights and shapes as Mitsuba gives them",
}
MONTE_CARLO = {"reference.monte_carlo.batches": "means and standard errors over batches"}
#: All that the two Monte Carlo estimators themselves ask of what they share with the quadrature.
ASKED = {"InputError", "TruthScene", "TruthMedium"}


@pytest.fixture(scope="module")
def sources():
    return {name: path.read_text() for name, path in modules().items()}


@pytest.fixture(scope="module")
def reach(sources):
    """Return by estimator all modules to which its imports lead, its own included."""
    graph = import_graph(sources)
    reach = {
        name: reached(graph, [module for module in graph if inside(module, folder)])
        for name, folder in ESTIMATORS.items()
    }
    assert all(ESTIMATORS[name] in known for name, known in reach.items())
    return reach


@pytest.mark.claim("no-shared-derivation")
@pytest.mark.parametrize("pair", list(combinations(ESTIMATORS, 2)), ids=" and ".join)
def test_two_estimators_share_nothing_but_what_is_listed(reach, pair):
    first, second = (reach[name] for name in pair)
    allowed = READING if "quadrature" in pair else READING | MONTE_CARLO
    assert first & second <= set(allowed)
    for name, other in (pair, pair[::-1]):
        assert not {module for module in reach[name] if inside(module, ESTIMATORS[other])}


def test_the_list_holds_nothing_that_is_not_shared(reach):
    shared = [first & second for first, second in combinations(reach.values(), 2)]
    assert set().union(*shared) == set(READING | MONTE_CARLO)


@pytest.mark.parametrize("name", ["single-scatter", "volpath"])
def test_monte_carlo_asks_the_shared_modules_for_records_alone(sources, name):
    names = set().union(*(imported(text) for module, text in sources.items() if inside(module, ESTIMATORS[name])))
    asked = {name.rpartition(".") for name in names}
    assert {word for module, _, word in asked if module in READING} <= ASKED
