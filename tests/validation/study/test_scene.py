# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace
from types import SimpleNamespace

import pytest

from validation.estimates import agreement
from validation.study.scene import check_reference, open_scene
from validation.study.study import Checks, Study

TINY = Study("tiny", ("open-fog",), sizes=((16, 12),))
CHECKS = Checks((8, 6), {"volpath": 0.5}, {"volpath": 8})


@pytest.mark.slow
def test_without_patience_the_clock_decides_nothing(variant, own_cache, monkeypatch):
    """Two runs, one of them on a machine so busy that hours pass between two batches: the same samples."""

    def checked(**changes):
        study = replace(TINY, checks=replace(CHECKS, **changes))
        return check_reference(open_scene("open-fog", study, {}))

    exact = {"margins": {"single-scatter": 0.01}, "samples": {"single-scatter": 8}}
    hours = iter(range(0, 10**9, 3600))
    quiet = checked(**exact)
    own_cache.rename(own_cache.with_name("other"))
    monkeypatch.setattr(agreement, "time", SimpleNamespace(monotonic=lambda: float(next(hours))))
    busy = checked(**exact)
    assert quiet
    assert busy == quiet
    impatient = checked(margins={"volpath": 1e-6}, patience=1.0)
    assert not any(verdict.finished for verdict in impatient.values())
