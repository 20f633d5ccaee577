# SPDX-License-Identifier: BSD-3-Clause
"""Protects the claim that a value which underflows breaks no bar, on any processor, and nothing else is let off."""

from dataclasses import replace

import numpy as np
import pytest

from validation.kernels.cases import Values
from validation.kernels.rays import table
from validation.kernels.stability import GENERATED, _broken

# Rays of which single terms are below 2^-126 though their sums are far above, with the J of each. A processor that
# flushes lost all of the first and the third, a nearly isotropic lobe, and 2.4 % of the second.
FLUSHED = (
    ("hazy", 132789.140625, 232308.1875, 0.0, 32985.58984375, 0.00022316776448860765, 1.2482876161892056e-33),
    ("rayleigh", 689046.9375, 1363.2552490234375, 0.0, 372320.25, 8.510394400218502e-05, 8.723572803710459e-32),
    ("isotropic", -438344.6875, 1188.7958984375, 0.0, 10104.048828125, 0.00013516764738596976, 3.828543456423609e-34),
)


def rays(*given):
    phase, foot, height, x0, x1, sigma_t, value = zip(*given)
    columns = {"foot": foot, "height": height, "x0": x0, "x1": x1, "sigma_t": sigma_t}
    arrays = {name: np.array(column, dtype=np.float64) for name, column in columns.items()}
    return replace(table(phase, np.zeros(len(phase)), tags=["thick"] * len(phase), **arrays), value=np.array(value))


def faults(cases, J, precision="single"):
    """Return what values break of the bar, if the other precision is right."""
    values = {precision: Values(cases.value, {}, np.ones(len(J), dtype=bool)) for precision in ("single", "double")}
    values[precision] = replace(values[precision], J=np.asarray(J, dtype=np.float64))
    return _broken(GENERATED, cases, values)


@pytest.mark.claim("underflow-breaks-no-bar")
@pytest.mark.parametrize("kept", [0.0, 0.5, 1.0])
def test_what_a_processor_flushes_on_the_way_breaks_no_bar(kept):
    cases = rays(*FLUSHED[::2])
    assert faults(cases, kept * cases.value) == []


@pytest.mark.claim("underflow-breaks-no-bar")
def test_what_remains_after_flushing_some_terms_breaks_no_bar():
    cases = rays(FLUSHED[1])
    assert faults(cases, [8.516171514327399e-32]) == []


def test_more_than_can_be_flushed_breaks_it():
    cases = rays(*FLUSHED)
    assert any("float32 maximum" in words for words in faults(cases, 10 * cases.value))


@pytest.mark.parametrize("value", [1e-20, 1e-27])
def test_a_dim_value_that_does_not_underflow_is_held_to_the_bar(value):
    """A short segment near the light in thick fog: its terms are far above the smallest numbers."""
    cases = rays(("isotropic", 5.0, 1.0, 0.0, 1.0, 10.0, value))
    assert faults(cases, [0.0])
    assert faults(cases, [1.001 * value])
