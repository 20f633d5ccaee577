# SPDX-License-Identifier: BSD-3-Clause
"""What the kept results of every report, and of `airlight paper`, have in common."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from validation.frames.result_cache import ResultCache, result_cache

#: Modules on which kept results depend, besides the four packages below `reports`.
_MAKERS = (
    "data/serialize.py",
    "plotting/pictures.py",
    "plotting/colour_maps.py",
    "report/scene.py",
    "report/papers.py",
)


def report_cache(environment: Mapping[str, Any], *, fresh: bool = False) -> ResultCache:
    """Return the cache of a run.

    Parameters
    ----------
    environment
        From `reports.machine.environment.describe_environment`.
    fresh
        Measure again what was kept from earlier runs.
    """
    here = Path(__file__).parent.parent
    machine = {name: str(environment.get(name)) for name in ("processor", "threads", "variant", "llvm", "device")}
    return result_cache(machine, more=[here / name for name in _MAKERS], fresh=fresh)
