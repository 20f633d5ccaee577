# SPDX-License-Identifier: BSD-3-Clause
"""airlight: how fast, accurate and stable is a real-time method for volumetric light?

The public Python API, re-exported from the packages that implement it, and the entry of the `airlight` command.
Names are imported when they are first used, so that `airlight --help` imports neither Mitsuba nor SciPy.

>>> import airlight
>>> truth = airlight.reference("open-fog", size=(32, 24))  # a built-in scene, or the path of a Mitsuba XML file
>>> frame = airlight.render("open-fog", "ray-march", size=(32, 24), steps=64)
>>> airlight.compare(truth, frame).metrics.relative_rmse < 0.01
True

`load_scene`, `render`, `reference`, `compare`, `fit`, `integrate`, `bench`, `slab` and `report` are all that a notebook
needs; the others are what these are made of.
"""

if __name__ == "__main__":  # before all that takes time: what a signal meets during an import ends in a traceback
    from reports.commands.start import main as start

    start()

import importlib
from typing import TYPE_CHECKING, Any

from reports import __version__

if TYPE_CHECKING:  # for editors, which complete names from here; `_API` says the same at run time
    from analytic.errors import InputError as InputError
    from realtime.frame.renderer import frame_renderer as frame_renderer
    from realtime.frame.renderer import render_frame as render_frame
    from realtime.kernels.registry import KERNELS as KERNELS
    from realtime.methods.interface.method import Method as Method
    from realtime.methods.registry import METHODS as METHODS
    from realtime.methods.registry import find_method as find_method
    from realtime.scene.read_scene import read_scene as read_scene
    from reference.storage.exr import read_exr as read_exr
    from reference.storage.exr import write_exr as write_exr
    from reports.api.fit import fit as fit
    from reports.api.images import compare as compare
    from reports.api.images import load_scene as load_scene
    from reports.api.images import render as render
    from reports.api.reference import reference as reference
    from reports.api.report import report as report
    from reports.api.slab import slab as slab
    from reports.api.studies import bench as bench
    from reports.api.studies import integrate as integrate
    from reports.api.studies import paper as paper
    from reports.machine.environment import MissingError as MissingError
    from reports.machine.environment import activate as activate
    from reports.machine.environment import versions as versions
    from validation.certified.files import certified_data as certified_data
    from validation.comparison.images import compare_files as compare_files
    from validation.estimates.budget import Budget as Budget
    from validation.estimates.images import monte_carlo_reference as monte_carlo_reference
    from validation.estimates.images import quadrature_reference as quadrature_reference
    from validation.estimates.images import volpath_reference as volpath_reference
    from validation.estimates.merge import merged_references as merged_references
    from validation.estimates.multiple_scattering import multiple_scattering_share as multiple_scattering_share
    from validation.metrics.errors import error_metrics as error_metrics
    from validation.scenes.registry import SCENES as SCENES
    from validation.study.configuration import configuration as configuration
    from validation.study.frame_times import time_frame as time_frame

# name -> module; names that are missing here are not part of the API
_API = {
    "load_scene": "reports.api.images",
    "render": "reports.api.images",
    "reference": "reports.api.reference",
    "compare": "reports.api.images",
    "fit": "reports.api.fit",
    "integrate": "reports.api.studies",
    "bench": "reports.api.studies",
    "paper": "reports.api.studies",
    "slab": "reports.api.slab",
    "report": "reports.api.report",
    "InputError": "analytic.errors",
    "MissingError": "reports.machine.environment",
    "activate": "reports.machine.environment",
    "versions": "reports.machine.environment",
    "SCENES": "validation.scenes.registry",
    "METHODS": "realtime.methods.registry",
    "Method": "realtime.methods.interface.method",
    "find_method": "realtime.methods.registry",
    "KERNELS": "realtime.kernels.registry",
    "configuration": "validation.study.configuration",
    "read_scene": "realtime.scene.read_scene",
    "frame_renderer": "realtime.frame.renderer",
    "render_frame": "realtime.frame.renderer",
    "time_frame": "validation.study.frame_times",
    "error_metrics": "validation.metrics.errors",
    "quadrature_reference": "validation.estimates.images",
    "volpath_reference": "validation.estimates.images",
    "monte_carlo_reference": "validation.estimates.images",
    "Budget": "validation.estimates.budget",
    "merged_references": "validation.estimates.merge",
    "multiple_scattering_share": "validation.estimates.multiple_scattering",
    "certified_data": "validation.certified.files",
    "compare_files": "validation.comparison.images",
    "read_exr": "reference.storage.exr",
    "write_exr": "reference.storage.exr",
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
    from reports.commands.start import main as start

    start()
