# SPDX-License-Identifier: BSD-3-Clause
"""Exceptions of the side under test beside `airlight.errors.InputError`."""


class NoDriverError(RuntimeError):
    """There is no OpenGL that can draw shaders. The message says why; what to install is
    the command line's to say.
    """


def root_of(error: BaseException) -> BaseException:
    """Return the first cause of an exception."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error
