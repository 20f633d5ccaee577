# SPDX-License-Identifier: BSD-3-Clause
"""Frozen functions that Python's garbage collector does not interrupt.

While Dr.Jit records a function, no memory of the device may be freed, and no object may vanish that virtual calls use:
a Mitsuba scene that is collected in the middle ends the process, or the recording fails. Garbage is collected later.

An exception in the function ends the recording as if the function had returned nothing, and is raised after the
recording: Dr.Jit 1.5 answers an exception in a recording by aborting a later one.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr

from realtime.errors import InputError, root_of


class Frozen:
    """A function frozen by `drjit.freeze`, during whose calls nothing is collected."""

    def __init__(self, function: Callable[..., Any], **options):
        # Not an attribute: a function that held this object would be collected at any moment, with the scenes it holds.
        raised: list[Exception] = []

        def recorded(*args):
            try:
                return function(*args)
            except Exception as error:  # of any kind: `__call__` raises it when the recording has ended
                raised.append(_without_frames(error))
                return None

        self._raised = raised
        self._recorded = dr.freeze(recorded, **options)

    def __call__(self, *args):
        """Call the function: the first time it is recorded, then replayed."""
        enabled = gc.isenabled()
        gc.disable()
        try:
            result = self._recorded(*args)
        finally:
            if enabled:
                gc.enable()
        if self._raised:
            self._recorded.clear()
            raise self._raised.pop()
        return result

    @property
    def n_recordings(self) -> int:
        """How often the function was recorded."""
        return self._recorded.n_recordings


def _without_frames(error: Exception) -> Exception:
    """Return an exception whose causes hold no frames: their arrays must not outlive the recording."""
    links: list[BaseException | None] = [error]
    seen = set()  # Dr.Jit may wrap an exception in one that has the first as its context: a circle
    while links:
        link = links.pop()
        if link is not None and id(link) not in seen:
            seen.add(id(link))
            link.__traceback__ = None
            links += [link.__cause__, link.__context__]
    return error


@contextmanager
def refusals() -> Iterator[None]:
    """Raise an `InputError` as it was: Dr.Jit wraps what is raised in the body of a loop or a branch."""
    try:
        yield
    except RuntimeError as error:
        root = root_of(error)
        if isinstance(root, InputError):
            raise root from None
        raise
