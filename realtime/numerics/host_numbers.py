# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of a scene brought from the device to the host, the one way in which a frame may do so.

What a frame reads so is a few numbers of lights and cameras; each such read waits until the device has come to rest.
"""

from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray


def host_numbers(*values: Any) -> tuple[NDArray[np.float64], ...]:
    """Bring values to the host together.

    `values`: Dr.Jit numbers and vectors of one type and one entry each, in any unit. Returns `numbers`: by value its
    components, (n,), in float64.
    """
    components = [tuple(value) if dr.depth_v(value) > 1 else (value,) for value in values]
    every = [component for of_value in components for component in of_value]
    numbers = _element_by_element(every) if _on_processor(every[0]) else _in_one_transfer(every)
    ends = np.cumsum([len(of_value) for of_value in components])
    return tuple(np.split(numbers, ends[:-1]))


def _on_processor(number: Any) -> bool:
    return bool(dr.backend_v(number) != dr.JitBackend.CUDA)


def _element_by_element(numbers: list[Any]) -> NDArray[np.float64]:
    """Read where they lie: on a processor a read takes less than a microsecond, and a copy of all a kernel."""
    return np.array([number[0] for number in numbers], dtype=np.float64)


def _in_one_transfer(numbers: list[Any]) -> NDArray[np.float64]:
    """Gather on the device, then transfer once: every transfer from a GPU waits for all that runs there."""
    return np.array(dr.concat(numbers), dtype=np.float64)
