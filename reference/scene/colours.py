# SPDX-License-Identifier: BSD-3-Clause
"""Colours of Mitsuba's lights and media as three numbers, each of which must be
one that an image can have.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.errors import InputError

Array = NDArray[np.float64]


def colour(value: ArrayLike, name: str, *, largest: float = np.inf) -> Array:
    """Return a number or a colour, of Mitsuba or of NumPy, as RGB, (3,).

    Raises InputError for numbers that are not finite, below 0 or above `largest`; the message calls
    the colour by `name`.
    """
    numbers = np.array(value, dtype=np.float64).reshape(-1)
    if not np.all(np.isfinite(numbers) & (numbers >= 0) & (numbers <= largest)):
        given = ", ".join(f"{number:g}" for number in numbers)
        most = f"from 0 to {largest:.3g}" if np.isfinite(largest) else "of 0 or more"
        raise InputError(f"{name} is {given}; expected finite numbers {most}")
    return np.repeat(numbers, 3) if numbers.size == 1 else numbers
