# SPDX-License-Identifier: BSD-3-Clause
"""JSON files that a user names."""

import json
from pathlib import Path
from typing import Any

from analytic.errors import InputError


def read_json(path: Path, wanted: str) -> Any:
    """Return what is in a JSON file; `wanted` says in words what it should be."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; wanted {wanted}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not valid JSON ({error}); wanted {wanted}") from error
