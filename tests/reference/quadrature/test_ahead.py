# SPDX-License-Identifier: BSD-3-Clause
import threading
import time

import pytest

from reference.quadrature.ahead import done_ahead


def test_results_come_in_order_whoever_is_first():
    def work(task):
        time.sleep(0.002 * (5 - task))
        return task**2

    assert list(done_ahead(work, range(5), workers=3)) == [0, 1, 4, 9, 16]


def test_no_more_is_begun_than_is_kept():
    """Rationale: results are large; a caller that is slower than the threads must not let them pile up."""
    begun = []
    results = done_ahead(lambda task: begun.append(task) or task, range(50), workers=2)
    for number, result in enumerate(results):
        assert result == number
        time.sleep(0.001)
        assert len(begun) <= number + 4  # three are kept, and one is done in the place of that which was handed out


def test_what_work_raises_comes_when_its_result_is_due():
    def work(task):
        if task == 2:
            raise ValueError("two")
        return task

    results = done_ahead(work, range(9), workers=2)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ValueError, match="two"):
        next(results)


def test_a_caller_that_stops_leaves_no_thread():
    before = threading.active_count()
    results = done_ahead(lambda task: time.sleep(0.001), range(1000), workers=2)
    next(results)
    results.close()
    deadline = time.monotonic() + 10
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() == before


@pytest.mark.slow
def test_surfaces_lit_by_lights_with_extent_do_not_depend_on_threads(variant):
    import drjit as dr
    import numpy as np

    from reference.quadrature.image import quadrature_image
    from reference.scene.read import read_truth
    from validation.scenes.loading import load_scene

    truth = read_truth(load_scene("penumbra-plane", (8, 6)).scene)
    before, images = dr.thread_count(), []
    try:
        for threads in (1, 3):
            dr.set_thread_count(threads)
            images.append(quadrature_image(truth))
    finally:
        dr.set_thread_count(before)
    assert np.array_equal(images[0].surface, images[1].surface)
