# SPDX-License-Identifier: BSD-3-Clause
"""Times and refusals as figures of claims: a number with the ends of its interval, or why there is none."""

from collections.abc import Callable
from typing import Any

from analytic.errors import InputError
from realtime.errors import InputError as RealtimeError
from realtime.frame.renderer import Frame, FrameRenderer, render_frame
from validation.clock import Timing, timed

LIMIT = 30.0  #: frames that take longer are not measured [s]


def milliseconds(timing: Timing) -> list[float]:
    """Return a median with its quartiles [ms]."""
    return [timing.median_ms, timing.low_ms, timing.high_ms]


def rate(timing: Timing) -> list[float]:
    """Return frames a second with their quartiles [1/s]."""
    return [1000 / timing.median_ms, 1000 / timing.high_ms, 1000 / timing.low_ms]


def frame_within(renderer: FrameRenderer, limit: float = LIMIT) -> Frame:
    """Render a frame, unless frames take too long for timing."""
    frame, milliseconds, _ = timed(lambda: render_frame(renderer))
    if milliseconds > 1e3 * limit:
        raise TimeoutError(f"a frame takes {1e-3 * milliseconds:.0f} s, more than the limit of {limit:g} s")
    return frame


def attempted(names: tuple[str, ...], work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return what a piece of work gives; what it does not give, by `names`, is why it could not."""
    try:
        return work()
    except (InputError, RealtimeError, MemoryError, TimeoutError) as reason:
        return dict.fromkeys(names, f"not measured: {str(reason) or 'out of memory'}")
