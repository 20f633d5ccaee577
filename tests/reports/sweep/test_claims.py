# SPDX-License-Identifier: BSD-3-Clause
"""Scenes are the sample of a sweep, not cells; its claims are fractions of them with
intervals; faults, refusals.
"""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from airlight.errors import InputError
from airlight.reports.sweep.claims import claim, correlations, strongest, sure
from airlight.reports.sweep.faults import checks, faults, reasons
from airlight.reports.sweep.samples import FILE, Fastest, fastest_within, read_sweep, samples
from airlight.reports.sweep.summary import summary_of
from airlight.reports.sweep.tables import errors_table
from airlight.validation.statistics.samples import binomial_interval
from tests.helpers.sweeps import row, rows, write_rows


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


_RIGHT, _NO_REFERENCE = (
    {"relative_rmse": 1e-5},
    {"status": "hung", "reason": "reference of random:1: stopped"},
)
#: Scenes as changes of a row, and what of them is tried, within, undecided, refused and untold.
TRIES = {
    "faults miss and refusals are no tries": (
        [
            _RIGHT,
            _RIGHT | {"nonfinite": 1},
            {"status": "failed", "reason": "x"},
            {"status": "refused", "reason": "x"},
            {"relative_rmse": None, "rmse": None, "nonfinite": 19200},
        ],
        (4, 1, 0, 1, 0),
    ),
    "no reference, no try": (
        [_RIGHT, _NO_REFERENCE, {"status": "hung", "reason": "stopped after 600 s"}],
        (2, 1, 0, 0, 1),
    ),
    "an error of the reference that is not known decides nothing": (
        [_RIGHT, {"relative_rmse": 5e-4, "reference_error": None}],
        (2, 1, 1, 0, 0),
    ),
    "what the reference cannot tell is undecided": (
        [
            *[_RIGHT] * 10,
            *({"relative_rmse": error, "reference_error": 2e-4} for error in (9e-4, 1.1e-3, 5e-3)),
        ],
        (13, 10, 2, 0, 0),
    ),
}


@pytest.mark.claim("sweep-tries")
@pytest.mark.parametrize("case", TRIES)
def test_what_is_tried_and_within(sweep_of, case):
    """Undecided scenes widen the interval on one side."""
    scenes, counted = TRIES[case]
    (sample,) = samples(
        sweep_of([row(f"random:{n}", **changes) for n, changes in enumerate(scenes)])
    )
    made = claim(sample, 1e-3)
    assert (made.tries, made.within, made.undecided, made.refused, made.untold) == counted
    tries, within, undecided, *_ = counted
    assert made.low == binomial_interval(within, tries)[0]
    assert made.high == binomial_interval(within + undecided, tries)[1]


@pytest.mark.claim("sweep-tries")
def test_a_scene_with_the_reference_of_one_medium_is_a_try(sweep_of):
    several = [row(**_NO_REFERENCE), row(medium="m", **_RIGHT)]
    made = claim(samples(sweep_of(several))[0], 1e-3)
    assert (made.tries, made.within, made.untold) == (1, 1, 0)


@pytest.mark.claim("sweep-properties")
def test_injected_property_is_found_and_no_other(sweep_of):
    sweep = sweep_of(rows(200))
    made = samples(sweep)
    found = correlations(sweep, made)
    assert len(found) == 5 * 5
    for sample in made:
        chosen = strongest(found, sweep, sample)
        assert [each.property for each in chosen] == (
            ["optical_depth"] if sample.method == "ray-march" else []
        )
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
    assert {each.property: each.r > 0 for each in chosen} == {
        "silhouettes": True,
        "nearest_light": False,
    }


@pytest.mark.claim("sweep-properties")
def test_intervals_hold_together(sweep_of):
    """Of 100 properties of noise none is sure in most sweeps; each by itself
    at 95 % would give five.
    """
    rng = np.random.default_rng(4)
    noise = [
        {f"property_p{k}": value for k, value in enumerate(rng.normal(size=100))}
        | {"relative_rmse": rng.lognormal()}
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
    assert refusal.reason == "SCENE has N lights, expected at most N"
    assert (refusal.cells, refusal.scenes) == (len(refused), len(refused))
    assert refusal.labels == ("light-volumes (exact)",)
    assert refusal.example == refused[0]["command"]
    assert (hung.status, hung.reason, hung.cells) == ("hung", "longer than N s", 1)


@pytest.mark.claim("sweep-faults")
def test_injected_faults_are_found_and_counted(sweep_of):
    several = rows(20)
    several[7] |= {"error.nonfinite": 12}
    several[8] |= {"error.negative": 5}
    several[6] |= {"surface_error.negative": 3}
    several[13] |= {"stated.outside": 2, "stated.bound": 1e-5}
    several[3] |= {"stated.outside": 0, "stated.bound": 1e-5}
    sweep = sweep_of(several)
    found = faults(sweep)
    assert [(each.check, each.scene, each.pixels, each.of) for each in found] == [
        ("not finite", several[7]["scene"], 12, 19200),
        ("negative", several[8]["scene"], 5, 19200),
        ("surface negative", several[6]["scene"], 3, 19200),
        ("outside of the bound", several[13]["scene"], 2, 19200),
    ]
    counted = {each.check: each for each in checks(sweep)}
    assert counted["outside of the bound"].rows == 2
    assert counted["outside of the bound"].faulty_scenes == 1
    assert counted["surface not finite"].rows == 0
    assert counted["negative"].rows == sum(each["status"] == "done" for each in several)


def test_scenes_that_were_left_out_for_their_time_are_told(sweep_of):
    """They were in no count: a slow method was within an error wherever it was tried."""
    why = {"status": "left out", "reason": "a frame would take 20 s, more than 10 s"}
    sweep = sweep_of([row(relative_rmse=1e-5), row("random:1", **why), row("random:2", **why)])
    (sample,) = samples(sweep)
    made = claim(sample, 1e-3)
    assert (made.tries, made.refused, made.left_out) == (1, 0, 2)
    assert made.text.endswith("; 2 more left out for their time.")
    assert [(each.status, each.cells) for each in reasons(sweep)] == [("left out", 2)]
    (shown,) = errors_table(summary_of(sweep)).rows
    assert shown.values["left_out"] == 2


def test_what_a_paper_has_too_is_no_fault(sweep_of):
    """A report calls such values published; a sweep called them faults."""
    several = [
        row("random:0", method="shadow-planes-2006", negative=5),
        row("random:0", method="light-volumes", kernel="taylor", nonfinite=2),
        row("random:0", method="shadow-planes", parameters={"order": "none"}, negative=7),
        row("random:1", negative=0),
    ]
    sweep = sweep_of(several)
    assert faults(sweep) == []
    counted = {each.check: each for each in checks(sweep)}
    found = [counted[name] for name in ("not finite", "negative")]
    assert [(each.rows, each.faulty_rows, each.published) for each in found] == [
        (1, 0, 1),
        (1, 0, 2),
    ]
    said = {(each.kind, each.good) for each in summary_of(sweep).headlines}
    assert {("As published", None), ("Sound", True)} <= said


def test_a_scene_is_within_only_as_far_as_the_reference_of_each_medium_tells(sweep_of):
    """The reference of the medium with the largest error hid another that knew nothing."""
    for known, counted in ((None, (0, 1)), (8e-4, (1, 0)), (1e-3, (0, 1))):
        several = [row(relative_rmse=5e-4), row(relative_rmse=1e-4, medium="m")]
        several[1]["reference.error"] = known
        made = claim(samples(sweep_of(several))[0], 1e-3)
        assert (made.within, made.undecided) == counted
        # One medium decides against the scene, whatever the other's reference may hide.
        several[0]["error.relative_rmse"] = 5e-3
        made = claim(samples(sweep_of(several))[0], 1e-3)
        assert (made.within, made.undecided) == (0, 0)


def test_references_without_an_error_are_counted_beside_the_known_ones(sweep_of):
    several = [row(), row("random:1", reference_error=None), row("random:2", reference_error=None)]
    for each, mean in zip(several, (1.0, 1.0, 0.0)):  # a black one has no relative error
        each["reference.mean"] = mean
    said = summary_of(sweep_of(several))
    assert (said.reference_errors, said.reference_unknown) == ((1e-7, 1e-7), 1)


def test_parquet_is_read_as_it_was_written(tmp_path):
    several = rows(4)
    sweep = read_sweep(write_rows(tmp_path / FILE, several).parent)
    assert len(sweep) == len(several) == 20
    by_key = {each["key"]: each for each in several}
    for place, key in enumerate(sweep["key"]):
        wanted = by_key.pop(key)
        assert sweep["scene"][place] == wanted["scene"]
        assert sweep.property("lights")[place] == wanted["properties.lights"]
        errors = [wanted["error.relative_rmse"] or np.nan]
        np.testing.assert_array_equal(sweep["error.relative_rmse"][place : place + 1], errors)
    assert not by_key
    assert sweep.properties == (
        "light_distance",
        "lights",
        "optical_depth",
        "silhouettes",
        "triangles",
    )
    assert set(sweep["cost.alone"][sweep["status"] == "done"]) == {1.0}


@pytest.mark.claim("sweep-from-parquet")
def test_order_in_which_rows_were_finished_does_not_matter(tmp_path):
    several = rows(12)
    first = read_sweep(write_rows(tmp_path / "a.parquet", several))
    second = read_sweep(write_rows(tmp_path / "b.parquet", several[::-1]))
    assert list(first["key"]) == list(second["key"])
    assert list(dict.fromkeys(first["scene"])) == [f"random:{n}" for n in range(12)]  # 9 before 10
    assert [each.label for each in samples(first)] == [each.label for each in samples(second)]


@pytest.mark.claim("sweep-last-rows")
def test_cells_that_were_computed_again_count_once(sweep_of):
    """A fault that is repaired is gone; a cell that was computed for its error and
    again for its time has both.
    """
    old, new = (
        {"source": "old", "started": "2026-11-23T08:00:00Z"},
        {"source": "new", "started": "2026-11-23T09:00:00Z"},
    )
    later = new | {"started": "2026-11-23T10:00:00Z"}
    several = [
        row(key="a", nonfinite=7, timed_alone=True, **old),
        row(key="b", timed_alone=False, frame_ms=5.0, **later),
        row(key="c", timed_alone=True, frame_ms=3.0, **new),
        row("random:1", key="d", **old),
        row("random:1", key="e", medium="m", **new),
        row("random:2", key="f", timed_alone=True, **old),
        row("random:2", key="g", timed_alone=False, **new),  # newer source goes before a time
    ]
    sweep = sweep_of(several)
    assert sorted(sweep["key"]) == ["c", "d", "e", "g"]
    assert sweep.superseded == 3


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, "is not there; expected the folder of a sweep"),
        (lambda path: path.write_bytes(b""), "cannot be read as Parquet"),
        (lambda path: pq.write_table(pa.table({"a": [1]}), path), "has no column 'scene'"),
        (lambda path: write_rows(path, []), "has no rows"),
        (
            lambda path: pq.write_table(
                pq.read_table(write_rows(path, [row()])).drop(["reference.error"]),
                path.with_name(FILE),
            ),
            "has no column 'reference.error'",
        ),
    ],
)
def test_what_is_no_sweep_is_refused_in_a_line(tmp_path, make, words):
    make(tmp_path / FILE)
    with pytest.raises(InputError, match=words) as caught:
        read_sweep(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.claim("sweep-scenes-are-the-sample")
def test_media_of_a_scene_are_one_sample_and_the_worst_stands_for_it(sweep_of):
    sweep = sweep_of(
        [
            row(relative_rmse=0.01),
            row(relative_rmse=0.3, medium="medium.sigma_t=1"),
            row(relative_rmse=0.02, medium="medium.sigma_t=2", nonfinite=4),
            row("random:1", relative_rmse=0.1),
        ]
    )
    (sample,) = samples(sweep)
    assert sample.scenes == ("random:0", "random:1")
    assert list(sample.errors) == [0.3, 0.1]
    assert list(sample.nonfinite) == [4, 0]  # also where it is not the worst cell that has them


@pytest.mark.claim("sweep-scenes-are-the-sample")
def test_named_scenes_are_no_sample_where_scenes_were_drawn(sweep_of):
    (drawn,) = samples(sweep_of([row(), row("hall"), row("random:7")]))
    assert drawn.scenes == ("random:0", "random:7")
    (named,) = samples(sweep_of([row("hall"), row("clutter")]))
    assert named.scenes == ("clutter", "hall")


@pytest.mark.claim("sweep-times-alone")
def test_times_of_several_hosts_are_not_compared(sweep_of):
    several = [
        row(f"random:{n}", host="there" if n > 1 else "here", threads=8 if n == 4 else 2)
        for n in range(5)
    ]
    (sample,) = samples(sweep_of(several))
    # Two rows each of both hosts with two threads: the first of them in the
    # sweep, and never a mixture.
    assert list(np.isfinite(sample.times)) == [True, True, False, False, False]


@pytest.mark.claim("sweep-times-alone")
def test_fastest_is_counted_where_all_were_timed_alone(sweep_of):
    def pair(scene, first, second, **changes):
        a = {"frame_ms": first[0], "relative_rmse": first[1]}
        b = {"frame_ms": second[0], "relative_rmse": second[1]}
        return [row(scene, **a), row(scene, method="min-max", **(b | changes))]

    sweep = sweep_of(
        [
            *pair("random:0", (1.0, 0.005), (2.0, 0.001)),
            *pair("random:1", (1.0, 0.5), (2.0, 0.001)),
            *pair("random:2", (1.0, 0.5), (2.0, 0.2)),
            *pair("random:3", (1.0, 0.5), (2.0, 0.001), nonfinite=1),
            *pair("random:4", (1.0, 0.001), (2.0, 0.001), timed_alone=False),
        ]
    )
    found = fastest_within(samples(sweep), 0.01)
    assert found == Fastest(0.01, dict.fromkeys(found.counts, 1), 2, 4)
    assert len(found.counts) == 2
