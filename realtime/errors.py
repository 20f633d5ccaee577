# SPDX-License-Identifier: BSD-3-Clause
"""The exception for mistakes of the user, on the side under test.

`analytic.errors` holds the same class for the side of truth, since the two sides share no code (DESIGN section 1). The
command line treats both alike.
"""


class InputError(ValueError):
    """Input that cannot be used. The message says in one line what was given, what is wanted and what to do."""
