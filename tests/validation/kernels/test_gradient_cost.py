# SPDX-License-Identifier: BSD-3-Clause
"""What derivatives cost: every kernel has a row, those that refuse a phase function say why."""

import pytest

from reports.tables.drawing import text
from reports.tables.kernels import gradient_table
from validation.kernels.gradient_cost import gradient_costs
from validation.metrics.errors import plain


def test_costs_of_a_kernel_and_a_refusal(variant):
    costs = gradient_costs(["exact", "table"], [("hg", 0.8)], rays=512, seconds=0.01)
    exact, table = costs
    assert (exact.kernel, exact.phase, exact.refused) == ("exact", "hg", None)
    # A derivative computes the value too; six take six passes. Times of few rays are noisy, so only the order counts.
    assert exact.every > exact.value > 0
    assert exact.sigma_t > 0
    assert table.value is None
    assert "not tabulated" in table.refused
    printed = text(gradient_table(plain(costs)))
    assert "refused" in printed
    assert "by sigma_t over value" in printed


@pytest.mark.parametrize("name", ["table", "table-tail"])
def test_a_table_has_no_derivative_and_says_so(variant, name):
    """Its values are piecewise bilinear: the derivatives that Dr.Jit would return are those of the pieces."""
    (table,) = gradient_costs([name], [("isotropic", 0.0)], rays=512, seconds=0.01)
    assert "no derivative" in table.refused
    assert "use the kernel 'exact'" in table.refused
