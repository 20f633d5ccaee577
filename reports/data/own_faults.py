# SPDX-License-Identifier: BSD-3-Clause
"""What user methods did wrong, found in the rows of a report."""

from collections.abc import Mapping
from typing import Any

from realtime.methods.shader.source import is_users


def own_fault(method: str, refused: str | None) -> str | None:
    """Return what a user method did wrong: what it refuses by name is a result, its faults are not.

    They begin with the name of the method (`realtime.methods.user_method`, `realtime.methods.shader`,
    `reports.machine.own_process`).
    """
    return refused if is_users(method) and refused and refused.startswith(f"method {method}: ") else None


def own_faults(data: Mapping[str, Any]) -> list[str]:
    """Return what user methods did wrong in a whole report, each once."""
    rows = (row for scene in data["scenes"] for row in scene["methods"] if row["kind"] == "function")
    return list(dict.fromkeys(filter(None, (own_fault(row["method"], row["refused"]) for row in rows))))
