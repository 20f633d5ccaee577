# SPDX-License-Identifier: BSD-3-Clause
"""What commands print: tables, and the same data as JSON."""

import os
import shutil
import sys
from typing import Any


def colours_wanted() -> bool:
    """Return whether colours and bold letters may be printed: NO_COLOR is not set, or empty (https://no-color.org)."""
    return not os.environ.get("NO_COLOR")


def terminal_width() -> int | None:
    """Return how wide the terminal is that is printed to [characters]; None where it is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def print_json(data: Any) -> None:
    """Print data as JSON; a number that is not finite is refused: what has none is None."""
    import json

    try:
        text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
    except ValueError:
        from analytic.errors import InputError

        raise InputError("a result is not finite, and is not printed; a number of the input may be too large") from None
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        text = json.dumps(data, indent=2, allow_nan=False)
    print(text)
