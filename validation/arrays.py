# SPDX-License-Identifier: BSD-3-Clause
"""Types that many files name: arrays, and functions that are told of progress."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.int64]

Progress = Callable[[float, str], None]  #: called with (fraction done, what)
Counted = Callable[[int, int, str], None]  #: called with (done, total, what)
