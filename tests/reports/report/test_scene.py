# SPDX-License-Identifier: BSD-3-Clause
import json
from dataclasses import asdict, dataclass

import numpy as np
import pytest

from reports.report.scene import reference_record
from validation.columns import plain


@dataclass(frozen=True)
class Sample:
    number: float
    pair: tuple


def test_plain_makes_what_json_can_hold():
    given = {
        "sample": Sample(np.float64(0.5), (np.int64(3), np.float32(0.25))),
        1: [np.bool_(True), None, "word", float("nan"), float("-inf"), np.float32("inf")],
    }
    written = plain(given)
    assert json.loads(json.dumps(written, allow_nan=False)) == {
        "sample": {"number": 0.5, "pair": [3, 0.25]},
        "1": [True, None, "word", None, None, None],
    }


@pytest.mark.parametrize("airlight", [np.zeros((2, 3, 3)), np.full((2, 3, 3), np.inf)])
def test_reference_without_light_that_is_finite_has_no_numbers_rather_than_nan(airlight):
    from reference.quadrature.ray_values import ReferenceImage

    black = np.zeros_like(airlight)
    found = reference_record(ReferenceImage(airlight, black, black, np.ones((2, 3)), np.ones((2, 3)), 0, float("nan")))
    json.dumps(asdict(found), allow_nan=False)
    assert found.relative_bound is None
    assert found.missed is None
