# SPDX-License-Identifier: BSD-3-Clause
"""For tests of `import airlight`: a small image, a method and a kernel of one's own."""

from airlight.realtime.kernels.exact import exact
from airlight.realtime.methods.unshadowed import unshadowed

TINY = (16, 12)


def brighter(view, *, kernel=None, times=2.0):
    """A method of one's own: all of the airlight, unshadowed, times something."""
    return times * unshadowed(view, kernel=kernel)


def third(geometry, x0, x1, medium, light):
    """A kernel of one's own."""
    return exact(geometry, x0, x1, medium, light) / 3
