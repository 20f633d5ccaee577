# SPDX-License-Identifier: BSD-3-Clause
"""What tables decide: is a reference confirmed, what grew too steeply, what is wrong as published, which bar broke."""

import pytest

from reports.tables.agreement import verdict
from reports.tables.scaling import cliffs, scaling_tables
from tests.helpers.reports import agreement, growth_record, record_of
from validation.statistics.records import Agreement
from validation.timing import Scaling


@pytest.mark.parametrize(
    ("equivalent", "interval", "finished", "good"),
    [
        (True, [-0.001, 0.003], True, True),
        (False, [-0.001, 0.03], True, False),
        (False, [-0.001, 0.03], False, None),  # not decided in time
        (False, [0.006, 0.03], False, False),  # outside as a whole
        (False, [None, None], False, False),
    ],
)
def test_a_reference_is_confirmed_refused_or_not_decided(equivalent, interval, finished, good):
    compared = agreement(equivalent, margin=0.005, finished=finished, relative_bias_ci=interval)
    assert verdict(record_of(compared, Agreement)) is good


def test_jumps_are_found():
    calm, jump = (record_of(growth_record(cliff=cliff), Scaling) for cliff in (False, True))
    assert len(cliffs([jump, calm])) == 1
    costs, exponents = scaling_tables([record_of(growth_record(works=(), refused="method x: no"), Scaling)])
    assert costs.rows[0].reason == "refused: method x: no"
    assert exponents.rows == ()
