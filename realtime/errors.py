# SPDX-License-Identifier: BSD-3-Clause
"""The exception for mistakes of the user, on the side under test.

`analytic.errors` holds the same class for the side of truth, since the two sides share no code (DESIGN section 1). The
command line treats both alike.
"""

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Input that cannot be used. The message says in one line what was given, what is wanted and what to do."""


class NoDriverError(RuntimeError):
    """There is no OpenGL that can draw shaders. The message says why; what to install is the command line's to say."""


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


def root_of(error: BaseException) -> BaseException:
    """Return what an exception was raised from first."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error
