# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the parts of a report that belong to no scene say all that was asked for."""

from dataclasses import replace

from realtime.kernels.registry import KERNELS
from reports.report import papers
from reports.report.papers import known_kernels, other_parts
from validation.frames.scene_study import EFFORTS


def test_kernels_are_studied_in_a_process_that_compiles_quickly_and_added_ones_here(own_cache, monkeypatch):
    """Rationale: another process imports the kernels of airlight, not what a notebook added to the registry."""
    named = []

    def studied(names, *, count, progress):
        named.append((*names, count))
        return [{"kernel": name} for name in names]

    def elsewhere(function, *arguments, quick, **how):
        named.append((function, *arguments, quick))
        return [{"kernel": name} for name in airlight_kernels]

    airlight_kernels = list(KERNELS)
    monkeypatch.setattr("validation.kernels.stability.stability", studied)
    monkeypatch.setattr(papers, "in_own_process", elsewhere)
    (part,) = other_parts(replace(EFFORTS["quick"], rays=64), [])
    expected = [{"kernel": name} for name in airlight_kernels]
    assert part.compute(lambda share, what: None) == ({"kernels": expected}, {})
    assert named == [(known_kernels, 64, True)]
    monkeypatch.setitem(KERNELS, "mine", KERNELS["exact"])
    assert part.compute(lambda share, what: None) == ({"kernels": [*expected, {"kernel": "mine"}]}, {})
    assert named[1:] == [(known_kernels, 64, True), ("mine", 64)]
