# SPDX-License-Identifier: BSD-3-Clause
# The public names, and where each is: read by editors, by type checkers and, when it is imported, by `airlight` itself.

__version__: str

from .errors import InputError as InputError
from .realtime.frame.image import render_frame as render_frame
from .realtime.frame.renderer import frame_renderer as frame_renderer
from .realtime.kernels.registry import KERNELS as KERNELS
from .realtime.methods.interface.marching import marched_steps as marched_steps
from .realtime.methods.interface.method import Layers as Layers
from .realtime.methods.interface.method import Method as Method
from .realtime.methods.registry import METHODS as METHODS
from .realtime.methods.registry import find_method as find_method
from .realtime.parameters import parameter as parameter
from .realtime.scene.light_table import light_choice as light_choice
from .realtime.scene.light_table import light_tables as light_tables
from .realtime.scene.read_scene import read_scene as read_scene
from .reference.scene.model import Model as Model
from .reference.storage.exr import read_exr as read_exr
from .reference.storage.exr import write_exr as write_exr
from .reports.api.capture import capture as capture
from .reports.api.challenge import challenge_board as challenge_board
from .reports.api.challenge import challenge_new as challenge_new
from .reports.api.challenge import challenge_score as challenge_score
from .reports.api.check import check as check
from .reports.api.compare import compare as compare
from .reports.api.diff import diff as diff
from .reports.api.explore import describe as describe
from .reports.api.explore import view as view
from .reports.api.export import export as export
from .reports.api.paper import paper as paper
from .reports.api.rays import rays as rays
from .reports.api.reference import reference as reference
from .reports.api.render import load_scene as load_scene
from .reports.api.render import render as render
from .reports.api.report import report as report
from .reports.api.sweep import sweep as sweep
from .reports.commands.list import list as list
from .reports.machine.doctor import doctor as doctor
from .reports.machine.environment import MissingError as MissingError
from .reports.machine.environment import activate as activate
from .reports.machine.environment import versions as versions
from .reports.studies.registry import STUDIES as STUDIES
from .reports.studies.registry import study as study
from .validation.certified.files import certified_data as certified_data
from .validation.estimates.images import Budget as Budget
from .validation.estimates.multiple_scattering import (
    multiple_scattering_fraction as multiple_scattering_fraction,
)
from .validation.metrics.errors import error_metrics as error_metrics
from .validation.scenes.registry import SCENES as SCENES
from .validation.study.configuration import configuration as configuration
from .validation.study.turns import time_frame as time_frame
