# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace
from types import SimpleNamespace

import pytest

from validation.study import scene as study
from validation.study.scene import Effort, open_study

TINY = Effort("tiny", (16, 12), (16, 12), (8, 6), {"volpath": 0.5}, {"volpath": 8}, 0.01)


@pytest.mark.slow
def test_without_patience_the_clock_decides_nothing(variant, own_cache, monkeypatch):
    """Two runs, one of them on a machine so busy that hours pass between two batches: the same samples."""
    from validation.estimates import agreement

    def checked():
        return study.check_truth(open_study("open-fog", replace(TINY, margins={"single-scatter": 0.01})))

    hours = iter(range(0, 10**9, 3600))
    quiet = checked()
    own_cache.rename(own_cache.with_name("other"))
    monkeypatch.setattr(agreement, "time", SimpleNamespace(monotonic=lambda: float(next(hours))))
    busy = checked()
    assert quiet
    assert busy == quiet
    impatient = study.check_truth(open_study("open-fog", replace(TINY, margins={"volpath": 1e-6}, patience=1.0)))
    assert not any(verdict.finished for verdict in impatient.values())
