# SPDX-License-Identifier: BSD-3-Clause
"""airlight: how fast, accurate and robust is a real-time method for volumetric light?

The public Python API, re-exported from the packages that implement it, and the entry of the `airlight` command.
Names are imported when they are first used, so that `airlight --help` imports neither Mitsuba nor SciPy.

>>> import airlight
>>> exact = airlight.reference("open-fog", size=(32, 24))  # a built-in scene, or the path of a Mitsuba XML file
>>> frame = airlight.render("open-fog", "ray-march", size=(32, 24), steps=64)
>>> airlight.compare(exact, frame).metrics.relative_rmse < 0.01
True

Every command is a function of the same name; the other names are what these are made of.
"""

if __name__ == "__main__":  # before all that takes time: what a signal meets during an import ends in a traceback
    from reports.commands.start import main as start

    start()

import importlib
from collections.abc import Sequence
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
    from reports.api.compare import compare as compare
    from reports.api.explore import describe as describe
    from reports.api.explore import view as view
    from reports.api.export import export as export
    from reports.api.reference import reference as reference
    from reports.api.render import load_scene as load_scene
    from reports.api.render import render as render
    from reports.api.report import diff as diff
    from reports.api.report import paper as paper
    from reports.api.report import report as report
    from reports.api.sweep import sweep as sweep
    from reports.commands.list import list_ as list  # noqa: F401 - exported
    from reports.machine.doctor import doctor as doctor
    from reports.machine.environment import MissingError as MissingError
    from reports.machine.environment import activate as activate
    from reports.machine.environment import versions as versions
    from reports.studies.registry import STUDIES as STUDIES
    from reports.studies.registry import study as study
    from validation.certified.files import certified_data as certified_data
    from validation.estimates.images import Budget as Budget
    from validation.estimates.multiple_scattering import multiple_scattering_fraction as multiple_scattering_fraction
    from validation.metrics.errors import error_metrics as error_metrics
    from validation.scenes.registry import SCENES as SCENES
    from validation.study.configuration import configuration as configuration
    from validation.study.frame_times import time_frame as time_frame

# name -> module, and the function there where it cannot have the name; what is missing here is not part of the API
_API = {
    # the commands
    "doctor": "reports.machine.doctor",
    "list": "reports.commands.list:list_",
    "render": "reports.api.render",
    "view": "reports.api.explore",
    "report": "reports.api.report",
    "diff": "reports.api.report",
    "sweep": "reports.api.sweep",
    "study": "reports.studies.registry",
    "reference": "reports.api.reference",
    "compare": "reports.api.compare",
    "describe": "reports.api.explore",
    "export": "reports.api.export",
    "paper": "reports.api.report",
    # scenes, what can be measured, and what the commands are made of
    "load_scene": "reports.api.render",
    "InputError": "analytic.errors",
    "MissingError": "reports.machine.environment",
    "activate": "reports.machine.environment",
    "versions": "reports.machine.environment",
    "SCENES": "validation.scenes.registry",
    "METHODS": "realtime.methods.registry",
    "Method": "realtime.methods.interface.method",
    "find_method": "realtime.methods.registry",
    "KERNELS": "realtime.kernels.registry",
    "STUDIES": "reports.studies.registry",
    "configuration": "validation.study.configuration",
    "read_scene": "realtime.scene.read_scene",
    "frame_renderer": "realtime.frame.renderer",
    "render_frame": "realtime.frame.renderer",
    "time_frame": "validation.study.frame_times",
    "error_metrics": "validation.metrics.errors",
    "Budget": "validation.estimates.images",
    "multiple_scattering_fraction": "validation.estimates.multiple_scattering",
    "certified_data": "validation.certified.files",
    "read_exr": "reference.storage.exr",
    "write_exr": "reference.storage.exr",
}

__all__ = ["__version__", "main", *_API]


def __getattr__(name: str) -> Any:
    if name not in _API:
        raise AttributeError(f"module 'airlight' has no attribute {name!r}")
    module, _, own = _API[name].partition(":")
    return getattr(importlib.import_module(module), own or name)


def __dir__() -> Sequence[str]:
    return sorted(__all__)


def main() -> None:
    """Run the `airlight` command."""
    from reports.commands.start import main as start

    start()
