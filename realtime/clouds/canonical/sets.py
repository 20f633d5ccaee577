# SPDX-License-Identifier: BSD-3-Clause
"""The eight sets of orders of Bouthors 2008, section 5.1; order 1 stands apart."""

import math

#: First and last order of each set.
SETS: tuple[tuple[int, float], ...] = (
    (2, 2),
    (3, 4),
    (5, 6),
    (7, 8),
    (9, 12),
    (13, 18),
    (19, 30),
    (31, math.inf),
)


def set_name(number: int) -> str:
    """Return '2', '3-4', .. '31-inf'."""
    first, last = SETS[number]
    if first == last:
        return str(first)
    return f"{first}-{int(last)}" if math.isfinite(last) else f"{first}-inf"
