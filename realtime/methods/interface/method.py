# SPDX-License-Identifier: BSD-3-Clause
"""The record of a method: its stages, and what a user and a frame must know of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from realtime.area_lights.points import LightPoints
from realtime.methods.interface.layers import Layers
from realtime.methods.interface.view import View
from realtime.parameters import Parameters, defaults, read_parameters, values
from realtime.scene.read_scene import Scene

#: What of a scene may change from frame to frame; `look` is all that moves nothing: the medium and the lights' colours.
MOVABLE = ("camera", "geometry", "light", "look")

#: What runs before a frame when things moved: a function of the scene as it is now that returns the method's state.
Preparation = Callable[[Scene], Any]


def never(parameters: Any) -> bool:
    """Return False, whatever the parameters."""
    return False


def always(parameters: Any) -> bool:
    """Return True, whatever the parameters."""
    return True


#: A cause of errors, and the values of parameters with which it is gone; None: all that the method has left.
ErrorCause = tuple[str, Mapping[str, Any] | None]


def no_causes(parameters: Any, size: tuple[int, int]) -> tuple[ErrorCause, ...]:
    """Return no cause of errors, whatever the parameters and the size of the image."""
    return ()


@dataclass(frozen=True)
class Method:
    """A method under its name: its stages in the order in which they run, then what a user and a frame must know.

    In a scene where nothing casts a shadow `cull` does not run, and lists are ().
    """

    name: str
    #: ``render(view, state, lists, *, kernel, parameters)``: the layers of every ray.
    render: Callable[..., Layers]
    summary: str
    source: str
    parameters: type[Parameters] = Parameters
    #: ``prepare(scene, parameters)`` checks what parameters ask of the scene and returns what makes the state: by light
    #: a shadow map, or shadow planes. It runs in every scene, and makes no maps where nothing casts a shadow. None: the
    #: state is ().
    prepare: Callable[[Scene, Any], Preparation] | None = None
    #: What `prepare` looks at; while that stands still, its state is kept.
    prepared_from: frozenset[str] = frozenset(MOVABLE)
    #: ``cull(view, state, parameters)``: by light lists of what concerns each tile, from camera, geometry and lights,
    #: without their colours and the media. None: there is nothing to sort, the lists are ().
    cull: Callable[[View, Any, Any], Any] | None = None
    #: ``f(layers, g_buffer, history, *, camera, parameters)`` -> layers: functions over the whole image, run in turn
    #: on what `render` returned. All arrays have an entry per pixel, row by row; `history` is None in the first frame.
    passes: tuple[Callable[..., Layers], ...] = ()
    passes_read_depth_alone: bool = False  #: whether they leave out normals and albedos, which the G-buffer then lacks
    #: Parameters -> whether `render` hands arrays of any sizes on to the next frame, as `Layers.carried`.
    carries: Callable[[Any], bool] = never
    runs_passes: Callable[[Any], bool] = always  #: parameters -> whether these run
    uses_kernel: Callable[[Any], bool] = always  #: parameters -> whether `render` calls an airlight kernel
    shadows: bool = True  #: whether it knows shadows; one that does not is wrong where there are occluders
    provides_visibility: Callable[[Any], bool] = never  #: parameters -> whether its layers have a visibility
    #: Whether it knows clouds of any shape and a sky. Then it says itself how the media dim the surfaces, and `prepare`
    #: runs where nothing casts a shadow too.
    renders_clouds: bool = False
    layers: tuple[str, ...] = ()  #: the names that `Layers.extra` may have, where a frame asks for further layers
    casts_rays: Callable[[Any], bool] = never  #: parameters -> whether it casts rays
    frozen: Callable[[Any], bool] = always  #: parameters -> whether Dr.Jit can record it once and replay it
    #: Parameters -> whether it computes each ray by itself, on any layout: then a frame may interpolate. It has the
    #: parameter `tolerance`, `realtime.tiles.adaptive_sampling.tolerance`. None: it has not.
    by_rays: Callable[[Any], bool] | None = None
    #: ``error_causes(parameters, (width, height))``: the causes of its errors in an image of that size [pixels], in the
    #: order in which `airlight study decomposition` takes them away, one on top of the other.
    error_causes: Callable[[Any, tuple[int, int]], tuple[ErrorCause, ...]] = no_causes
    #: Parameters -> whether it is given all lights of a frame at once, the points of lights with extent among them. If
    #: not, and if it has no passes over the image, it is given one light point after another, and where there are many
    #: lights one after another: what it returns is added up, and it is recorded once for all of one structure.
    lights_at_once: Callable[[Any], bool] = never
    #: Parameters -> whether its visibility has one entry for all points of a light with extent, and one for each other
    #: light: then surfaces are shaded by source too.
    by_source: Callable[[Any], bool] = never
    light_points: LightPoints = field(default_factory=LightPoints)  #: how it renders lights with extent by default

    @property
    def defaults(self) -> dict[str, Any]:
        """The defaults of its parameters by their names."""
        return defaults(self.parameters)


def method_parameters(method: Method, given: Mapping[str, Any]) -> tuple[Any, LightPoints]:
    """Return the parameters of a method, and those of lights with extent, which all methods have in common.

    Parameters
    ----------
    method
        The method.
    given
        Values by name; a word is converted to the type of the default.

    Raises
    ------
    InputError
        As `realtime.parameters.read_parameters`.
    """
    common = [item.name for item in fields(LightPoints) if item.name not in method.defaults]
    own = {name: value for name, value in given.items() if name not in common}
    asked = {name: value for name, value in given.items() if name in common}
    chosen = read_parameters(method.name, method.parameters, own, others=common)
    read = values(read_parameters(method.name, LightPoints, asked))
    return chosen, replace(method.light_points, **{name: read[name] for name in asked})
