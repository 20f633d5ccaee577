# SPDX-License-Identifier: BSD-3-Clause
"""airlight: how fast, accurate and stable is a real-time method for volumetric light?

The public Python API, re-exported from the packages that implement it, and the entry of the `airlight` command.
Names are imported when they are first used, so that `airlight --help` imports neither Mitsuba nor SciPy.

>>> import airlight
>>> truth = airlight.reference("open-fog", size=(32, 24))  # a built-in scene, or the path of a Mitsuba XML file
>>> frame = airlight.render("open-fog", "ray-march", size=(32, 24), steps=64)
>>> airlight.compare(truth, frame).metrics.relative_rmse < 0.01
True

`load_scene`, `render`, `reference`, `compare`, `integrate`, `bench` and `report` are all that a notebook needs; the
others are what these are made of.
"""

import importlib
import sys
from typing import TYPE_CHECKING, Any

from reports import __version__

if TYPE_CHECKING:  # for editors, which complete names from here; `_API` says the same at run time
    from analytic.errors import InputError as InputError
    from realtime.frame import frame_renderer as frame_renderer
    from realtime.frame import render_frame as render_frame
    from realtime.kernels import KERNELS as KERNELS
    from realtime.methods import METHODS as METHODS
    from realtime.methods import Method as Method
    from realtime.methods import find_method as find_method
    from realtime.scene import read_scene as read_scene
    from reference.exr import read_exr as read_exr
    from reference.exr import write_exr as write_exr
    from reports.api import compare as compare
    from reports.api import load_scene as load_scene
    from reports.api import render as render
    from reports.api_report import report as report
    from reports.api_studies import bench as bench
    from reports.api_studies import integrate as integrate
    from reports.api_truth import reference as reference
    from reports.environment import MissingError as MissingError
    from reports.environment import activate as activate
    from reports.environment import versions as versions
    from validation.budget import Budget as Budget
    from validation.certified_fog import certified_data as certified_data
    from validation.compare import compare_files as compare_files
    from validation.configurations import configuration as configuration
    from validation.known_answers import known_answers as known_answers
    from validation.merge import merged_references as merged_references
    from validation.metrics import error_metrics as error_metrics
    from validation.multiple import multiple_scattering_share as multiple_scattering_share
    from validation.references import monte_carlo_reference as monte_carlo_reference
    from validation.references import quadrature_reference as quadrature_reference
    from validation.references import volpath_reference as volpath_reference
    from validation.scenes import SCENES as SCENES
    from validation.timing import time_frame as time_frame

# name -> module; what is not named here is no part of the API.
_API = {
    "load_scene": "reports.api",
    "render": "reports.api",
    "reference": "reports.api_truth",
    "compare": "reports.api",
    "integrate": "reports.api_studies",
    "bench": "reports.api_studies",
    "report": "reports.api_report",
    "InputError": "analytic.errors",
    "MissingError": "reports.environment",
    "activate": "reports.environment",
    "versions": "reports.environment",
    "SCENES": "validation.scenes",
    "METHODS": "realtime.methods",
    "Method": "realtime.methods",
    "find_method": "realtime.methods",
    "KERNELS": "realtime.kernels",
    "configuration": "validation.configurations",
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
