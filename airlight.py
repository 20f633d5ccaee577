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

import importlib
import importlib.util
import sys
from pathlib import Path


def _load_own_packages() -> None:
    """Load the five packages from beside this file: a user's folder may hold packages of the same names."""
    for name in ("analytic", "realtime", "reference", "validation", "reports"):
        page = Path(__file__).with_name(name) / "__init__.py"
        loaded = getattr(sys.modules.get(name), "__file__", None)
        if name not in sys.modules:
            spec = importlib.util.spec_from_file_location(name, page)
            assert spec is not None
            assert spec.loader is not None  # of a file that ends in .py
            sys.modules[name] = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(sys.modules[name])
        elif loaded is None or not page.samefile(loaded):
            raise ImportError(
                f"airlight has a package {name!r}, and {loaded or sys.modules[name]} was imported under this name "
                "before: import airlight first, or rename that one"
            )


_load_own_packages()

if __name__ == "__main__":  # before all that takes time: what a signal meets during an import ends in a traceback
    from reports.commands.start import main as start

    start()

import ast
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from reports import __version__

if TYPE_CHECKING:  # the public names: editors complete them from here, and at run time `_exported` reads them
    from analytic.errors import InputError as InputError
    from realtime.frame.renderer import frame_renderer as frame_renderer
    from realtime.frame.renderer import render_frame as render_frame
    from realtime.kernels.registry import KERNELS as KERNELS
    from realtime.methods.interface.marching import marched_steps as marched_steps
    from realtime.methods.interface.method import Layers as Layers
    from realtime.methods.interface.method import Method as Method
    from realtime.methods.registry import METHODS as METHODS
    from realtime.methods.registry import find_method as find_method
    from realtime.parameters import parameter as parameter
    from realtime.scene.light_samples import light_tables as light_tables
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
    from validation.study.turns import time_frame as time_frame


def _exported() -> dict[str, tuple[str, str]]:
    """Return the module and the name there of each name above, read from this file."""
    block = next(
        each
        for each in ast.parse(Path(__file__).read_text(encoding="utf-8")).body
        if isinstance(each, ast.If) and ast.unparse(each.test) == "TYPE_CHECKING"
    )
    imports = (each for each in block.body if isinstance(each, ast.ImportFrom))
    return {name.asname or name.name: (each.module or "", name.name) for each in imports for name in each.names}


_API = _exported()
__all__ = ["__version__", *_API]


def __getattr__(name: str) -> Any:
    if name not in _API:
        raise AttributeError(f"module 'airlight' has no attribute {name!r}")
    module, own = _API[name]
    return getattr(importlib.import_module(module), own)


def __dir__() -> Sequence[str]:
    return sorted(__all__)
