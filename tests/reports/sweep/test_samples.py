# SPDX-License-Identifier: BSD-3-Clause
"""Scenes are the sample, not cells; what is read of a Parquet is what was written."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from analytic.errors import InputError
from reports.sweep.read import FILE, read_sweep
from reports.sweep.samples import Fastest, fastest_within, samples
from tests.helpers.sweeps import row, rows, write_rows


@pytest.fixture
def sweep_of(tmp_path):
    return lambda several: read_sweep(write_rows(tmp_path / FILE, several))


def test_parquet_is_read_as_it_was_written(tmp_path):
    several = rows(4)
    sweep = read_sweep(write_rows(tmp_path / FILE, several).parent)
    assert len(sweep) == len(several) == 20
    by_key = {each["key"]: each for each in several}
    for place, key in enumerate(sweep.texts("key")):
        wanted = by_key.pop(key)
        assert sweep.texts("scene")[place] == wanted["scene"]
        assert sweep.property("lights")[place] == wanted["properties.lights"]
        errors = [wanted["error.relative_rmse"] or np.nan]
        np.testing.assert_array_equal(sweep.numbers("error.relative_rmse")[place : place + 1], errors)
    assert not by_key
    assert sweep.properties == ("light_distance", "lights", "optical_depth", "silhouettes", "triangles")
    assert set(sweep.numbers("cost.alone")[sweep.texts("status") == "done"]) == {1.0}


@pytest.mark.claim("sweep-from-parquet")
def test_order_in_which_rows_were_finished_does_not_matter(tmp_path):
    several = rows(12)
    first = read_sweep(write_rows(tmp_path / "a.parquet", several))
    second = read_sweep(write_rows(tmp_path / "b.parquet", several[::-1]))
    assert list(first.texts("key")) == list(second.texts("key"))
    assert list(dict.fromkeys(first.texts("scene"))) == [f"random:{n}" for n in range(12)]  # 9 before 10
    assert [each.label for each in samples(first)] == [each.label for each in samples(second)]


@pytest.mark.claim("sweep-last-rows")
def test_cells_that_were_computed_again_count_once(sweep_of):
    """A fault that is mended is gone; a cell that was computed for its error and again for its time has both."""
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
    assert sorted(sweep.texts("key")) == ["c", "d", "e", "g"]
    assert sweep.superseded == 3


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: None, "is not there; wanted the folder of a sweep"),
        (lambda path: path.write_bytes(b""), "cannot be read as Parquet"),
        (lambda path: pq.write_table(pa.table({"a": [1]}), path), "has no column 'key'"),
        (lambda path: write_rows(path, []), "has no rows"),
        (
            lambda path: pq.write_table(
                pq.read_table(write_rows(path, [row()])).drop(["reference.error"]), path.with_name(FILE)
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
    several = [row(f"random:{n}", host="there" if n > 1 else "here", threads=8 if n == 4 else 2) for n in range(5)]
    (sample,) = samples(sweep_of(several))
    # Two rows each of both hosts with two threads: the first of them in the sweep, and never a mixture.
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
    assert fastest_within(samples(sweep), 0.01) == Fastest(0.01, (1, 1), 2, 4)
