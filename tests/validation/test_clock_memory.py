# SPDX-License-Identifier: BSD-3-Clause
"""The peak of the memory is that of the work, also where it is free again at its end."""

import sys

import numpy as np
import pytest

from validation.clock import peak_memory


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux lets a process forget an earlier peak")
def test_the_peak_is_that_of_what_was_held_together(variant):
    def work(mebibytes):
        held = np.ones(mebibytes * 2**17)
        assert held.sum() > 0

    work(200)  # an earlier peak does not count
    # The kernel counts pages in batches, and the allocator takes some.
    assert 94 < peak_memory(lambda: work(96)) < 104
    assert peak_memory(lambda: None) < 4
