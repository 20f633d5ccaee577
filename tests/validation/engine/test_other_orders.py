# SPDX-License-Identifier: BSD-3-Clause
"""An image of a cloud that holds light of all orders is told from faults of single scattering."""

from functools import partial

import pytest

import airlight
from airlight.reference.storage.exr import Image
from airlight.validation.engine.judge import compare_scene
from airlight.validation.engine.observation import scene_of_size
from airlight.validation.engine.other_orders import other_orders

SIZE = (16, 12)


@pytest.fixture(scope="module")
def once():
    """The light of one scattering in a cloud whose further orders are 31 times as bright."""
    return airlight.reference("step-cloud", size=SIZE).airlight


@pytest.mark.claim(
    "engine-orders", tolerance="0.15 of the light of further orders, 8 batches of 16 paths"
)
@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize(
    ("scene", "excess", "named"),
    [
        ("step-cloud", 31.0, True),
        ("step-cloud", 15.0, True),  # a method that misses half of it
        ("step-cloud", 0.5, False),  # less than an image of all orders can have
        ("step-cloud", 99.0, False),  # more
        ("step-cloud", -0.5, False),
        ("open-fog", 0.2, False),  # no cloud: the diagnosis predicts further orders itself
    ],
)
def test_further_orders_are_named_where_they_are_as_bright(scene, excess, named):
    at_size = partial(scene_of_size, scene, path="image.exr")
    found = other_orders(at_size(SIZE), at_size, "airlight", excess)
    assert (found is not None) == named
    # 32 by 64 paths a pixel; the noise of 8 batches of 16 is below 5 %.
    assert found is None or found.more == pytest.approx(31, rel=0.15)


@pytest.mark.claim("engine-orders")
@pytest.mark.usefixtures("variant")
def test_a_comparison_and_a_diagnosis_name_the_orders_and_no_factor(once, tmp_path):
    path = tmp_path / "cloud.exr"
    airlight.write_exr(path, Image({"airlight": 31.0 * once}))
    verdict = compare_scene("step-cloud", path).verdict
    assert not verdict.right
    assert "light that was scattered once" in verdict.reasons[0]
    assert not any("should be" in reason for reason in verdict.reasons)
    (said,) = airlight.compare("step-cloud", path, diagnose=True).diagnoses
    assert (said.first, said.explained) == ("orders", False)
    # The light of one scattering is right, and a fault of it is named as before.
    assert airlight.compare("step-cloud", once).verdict.right
