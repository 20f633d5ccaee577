# SPDX-License-Identifier: BSD-3-Clause
"""Frozen functions that Python's garbage collector does not interrupt.

While Dr.Jit records a function, no memory of the device may be freed, and no object may vanish that
virtual calls use: a Mitsuba scene that is collected in the middle ends the process, or the
recording fails. Garbage is collected later.

The collector is one for all threads of the process, so it pauses until the last of
several calls has returned.

An exception in the function, an interrupt by the user among them, ends the recording as if the
function had returned nothing, and is raised after the recording: Dr.Jit 1.5 answers an exception in
a recording by aborting a later one.
"""

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr

from airlight.errors import InputError
from airlight.realtime.errors import root_of


class _CollectorPause:
    """A context in which no garbage is collected; of contexts that overlap, the
    last one ends the pause.
    """

    def __init__(self) -> None:
        self._lock, self._contexts, self._enabled = threading.Lock(), 0, False

    def __enter__(self) -> None:
        with self._lock:
            if self._contexts == 0:
                self._enabled = gc.isenabled()
                gc.disable()
            self._contexts += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._contexts -= 1
            if self._contexts == 0 and self._enabled:
                gc.enable()


_PAUSE = _CollectorPause()  # one, as the collector is


class Frozen:
    """A function frozen by `drjit.freeze`, during whose calls nothing is collected."""

    def __init__(self, function: Callable[..., Any], **options):
        # Not an attribute: a function that held this object would be collected at any moment,
        # with the scenes it holds.
        raised = threading.local()  # another thread may call the function meanwhile

        def recorded(*args):
            try:
                return function(*args)
            # of any kind: `__call__` raises it when the recording has ended
            except BaseException as error:
                # Dr.Jit wraps what is raised in the body of a loop or a branch
                interrupt = root_of(error)
                raised.error = _without_frames(
                    interrupt if isinstance(interrupt, KeyboardInterrupt) else error
                )
                return None

        self._raised = raised
        self._recorded = dr.freeze(recorded, **options)

    def __call__(self, *args):
        """Call the function: the first time it is recorded, then replayed."""
        # An exception of an earlier call must not be raised by this one.
        self._raised.error = None
        with _PAUSE:
            result = self._recorded(*args)
        error, self._raised.error = self._raised.error, None
        if error is not None:
            # The recording returned nothing: a replay of it would return nothing, too.
            self._recorded.clear()
            raise error
        return result

    @property
    def n_recordings(self) -> int:
        """How often the function was recorded."""
        return self._recorded.n_recordings


def _without_frames(error: BaseException) -> BaseException:
    """Return an exception whose causes hold no frames: their arrays must
    not outlive the recording.
    """
    links: list[BaseException | None] = [error]
    # Dr.Jit may wrap an exception in one that has the first as its context: a circle.
    visited = set()
    while links:
        link = links.pop()
        if link is not None and id(link) not in visited:
            visited.add(id(link))
            link.__traceback__ = None
            links += [link.__cause__, link.__context__]
    return error


@contextmanager
def refusals() -> Iterator[None]:
    """Raise an `InputError` as it was: Dr.Jit wraps what is raised in the
    body of a loop or a branch.
    """
    try:
        yield
    except RuntimeError as error:
        root = root_of(error)
        if isinstance(root, InputError):
            raise root from None
        raise
