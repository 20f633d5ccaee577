# SPDX-License-Identifier: BSD-3-Clause
"""airlight: how fast, accurate and stable is a real-time method for volumetric light?

The public Python API, re-exported from the packages that implement it, and the entry of the `airlight` command.
Names are imported when they are first used, so that `airlight --help` imports neither Mitsuba nor SciPy.

>>> import airlight
>>> airlight.activate()                       # choose a Mitsuba variant that works here
'llvm_ad_rgb'
>>> loaded = airlight.load_scene("open-fog")  # a built-in scene, or the path of a Mitsuba XML file
"""

import importlib
import sys
from typing import Any

from reports import __version__

# name -> module; what is not named here is no part of the API.
_API = {
    "InputError": "analytic.errors",
    "MissingError": "reports.environment",
    "activate": "reports.environment",
    "versions": "reports.environment",
    "SCENES": "validation.scenes",
    "METHODS": "realtime.methods",
    "KERNELS": "realtime.kernels",
    "load_scene": "validation.load",
    "read_scene": "realtime.scene",
    "frame_renderer": "realtime.frame",
    "render_frame": "realtime.frame",
    "time_frame": "validation.timing",
    "error_metrics": "validation.metrics",
    "quadrature_reference": "validation.references",
    "volpath_reference": "validation.references",
    "monte_carlo_reference": "validation.references",
    "Budget": "validation.budget",
    "merged_references": "validation.merge",
    "multiple_scattering_share": "validation.multiple",
    "known_answers": "validation.known_answers",
    "certified_data": "validation.certified_fog",
    "compare_files": "validation.compare",
    "read_exr": "reference.exr",
    "write_exr": "reference.exr",
}

__all__ = ["__version__", "main", *_API]


def __getattr__(name: str) -> Any:
    if name not in _API:
        raise AttributeError(f"module 'airlight' has no attribute {name!r}")
    return getattr(importlib.import_module(_API[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)


def main() -> None:
    """Run the `airlight` command."""
    from reports.cli import run

    sys.exit(run(sys.argv[1:]))


if __name__ == "__main__":
    main()
