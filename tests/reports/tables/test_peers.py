# SPDX-License-Identifier: BSD-3-Clause
"""What is wrong in a paper is the paper's: such configurations are named, and no others."""

import pytest

from reports.tables.peers import published_as
from tests.helpers.reports import entry
from validation.configurations.methods import STANDARD


@pytest.mark.parametrize(
    ("kernel", "parameters", "words"),
    [
        ("taylor", {}, "wrong away from the foot"),
        ("exact", {"order": "none"}, "count twice"),
        ("taylor", {"order": "paper"}, "stencil rule"),
        ("exact", {"steps": 100, "order": "exact"}, ""),
        (None, {"steps": 100, "spacing": "uniform"}, ""),
    ],
)
def test_published_as(kernel, parameters, words):
    said = published_as(entry("m", kernel=kernel, parameters=parameters))
    assert words in said
    assert bool(said) == bool(words)


def test_peers_among_what_a_report_measures():
    peers = [c.label for c in STANDARD if published_as({"kernel": c.kernel, "parameters": dict(c.parameters)})]
    assert peers == [
        "unshadowed (taylor)",
        "shadow-planes (taylor)",
        "shadow-planes (exact, order=paper)",
        "shadow-planes (exact, order=none)",
        "shadow-planes (exact, media=paper)",
        "light-volumes (taylor)",
    ]
