# SPDX-License-Identifier: BSD-3-Clause
"""The exception for what the user got wrong, on the side under test.

`analytic.errors` holds its twin: the two sides share no code (DESIGN section 1), and the command line reports both
alike.
"""


class InputError(ValueError):
    """Something that the user gave cannot be used; the message says what was given, what is wanted and what to do."""
