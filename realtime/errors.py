# SPDX-License-Identifier: BSD-3-Clause
"""The exception for mistakes of the user, on the side under test.

`analytic.errors` holds the same class for the side of the reference, since the two sides share no code (DESIGN section
1). The command line treats both alike.
"""


class InputError(ValueError):
    """Input that cannot be used. The message says in one line what was given, what is expected and what to do."""


class NoDriverError(RuntimeError):
    """There is no OpenGL that can draw shaders. The message says why; what to install is the command line's to say."""


def root_of(error: BaseException) -> BaseException:
    """Return the first cause of an exception."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error
