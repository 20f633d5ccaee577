# SPDX-License-Identifier: BSD-3-Clause
"""Tables of scaling hold every step and exponent, and a jump becomes a sentence."""

from reports.tables.drawing import markdown
from reports.tables.scaling import cliffs, scaling_tables


def record(*, cliff, refused=None, works=(100.0, 400.0)):
    def timing(time):
        return {"median_ms": time, "low_ms": time, "high_ms": time, "repetitions": 5}

    growth = {"exponent": 0.47, "standard_error": 0.01, "steepest": 1.93, "at": works[-1] if works else None}
    times = ("frame", "light_moved", "objects_moved")
    return {
        "scene": "hall",
        "size": [80, 60],
        "label": "shadow-planes (exact)",
        "kind": "triangles",
        "costs": [
            {"work": work, "memory": 71.5} | {name: timing(0.31 * work) for name in (*times, "rays")} for work in works
        ],
        "growth": {name: growth | {"cliff": cliff and name == "frame"} for name in times},
        "refused": refused,
    }


def test_a_table_for_each_kind_and_one_of_exponents():
    costs, exponents = scaling_tables([record(cliff=True)])
    assert costs.title == "hall by triangles, 80 x 60"
    assert [row.values["work"] for row in costs.rows] == [100, 400]
    assert "71.5" in markdown(costs)
    drawn = markdown(exponents).splitlines()[-1]
    assert "0.47" in drawn
    assert drawn.endswith("| frame |")
    assert markdown(scaling_tables([record(cliff=False)])[1]).splitlines()[-1].endswith("| no |")


def test_who_refuses_is_named_and_has_no_exponent():
    costs, exponents = scaling_tables([record(cliff=False, works=(), refused="method x: no")])
    assert "refused: method x: no" in markdown(costs)
    assert exponents.rows == ()


def test_a_jump_is_a_sentence():
    (sentence,) = cliffs([record(cliff=True), record(cliff=False)])
    assert sentence == "hall, shadow-planes (exact): frame grows with the power 1.9 of the triangles up to 400"
