# SPDX-License-Identifier: BSD-3-Clause
"""A frame: camera rays, the lit surface, what the method sorts by tiles, its layers, and passes over the whole image.

Each stage is one frozen function. Frozen functions (`drjit.freeze`) record their kernels on the first call and replay
them afterwards, so a frame costs its kernels and little else. A method whose arrays change their sizes from frame to
frame cannot be frozen. All that moves (camera, lights, medium, shadow maps) is passed in as opaque arrays. What of a
frame serves the next one too: `realtime.frame.incremental`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.errors import InputError
from realtime.frame.frame_view import frame_view
from realtime.frame.layers import adaptive_layers, composed, image_passes
from realtime.frame.light_on_ray import check_radiance
from realtime.frame.recorded import Frozen
from realtime.frame.surface import Cast
from realtime.frame.surface_stages import no_surface, surface_stages
from realtime.kernels.preparation import prepare_kernel, with_tables
from realtime.methods.interface.layers import History
from realtime.methods.interface.method import Method, Preparation
from realtime.numerics.array_types import Metres, PerRay
from realtime.parameters import read_parameters
from realtime.scene.camera import tiled_pixels
from realtime.scene.read_scene import Scene
from realtime.tiles.adaptive_sampling import Corners, tile_corners
from realtime.tiles.layout import TILE


@dataclass(frozen=True)
class FrameRenderer:
    """The stages of a frame of one scene with one method, ready to be run any number of times."""

    scene: Scene
    method: Method
    pixel: PerRay  #: pixel numbers in the order of the lanes
    prepare: Preparation  #: scene -> the state of the method: shadow maps, shadow planes
    surface: Callable[..., Any]  #: -> what camera rays meet, and what `shade` returns for it
    shade: Callable[..., Any]  #: -> surface radiance: by light where the method knows their visibility, or a sum
    cull: Callable[..., Any]  #: -> what concerns each tile; () where the method sorts nothing
    render: Callable[..., Any]  #: -> airlight, and the surface where layers change it; layers where there are passes
    passes: Callable[..., Any] | None  #: -> airlight, surface and what they leave; None where the method has none
    tables: Any  #: what the kernel reads; None for most
    corners: Corners | None  #: how the tiles of the image lie; None where every pixel is computed
    lane: PerRay | None  #: the entry of every pixel row by row, for passes
    shade_casts_rays: bool  #: whether shading asks Mitsuba for shapes or shadows
    casts_rays: bool  #: whether the method casts rays of its own
    carries: bool  #: whether the method hands arrays on to the next frame

    # A frozen function reads all shapes of a scene that it is given anew at every call.

    @property
    def shade_geometry(self) -> Any:
        """The Mitsuba scene if shading needs it."""
        return self.scene.geometry if self.shade_casts_rays else None

    @property
    def geometry(self) -> Any:
        """The Mitsuba scene if the method needs it."""
        return self.scene.geometry if self.casts_rays else None


@dataclass(frozen=True)
class Frame:
    """What a frame shows, as float arrays of shape (height, width[, 3])."""

    airlight: Any  #: in-scattered radiance [W/(m^2 sr)]
    surface: Any  #: radiance of the lit surface through the medium [W/(m^2 sr)]
    distance: Any  #: to the visible surface, infinite where there is none [m]


def frame_renderer(scene: Scene, method: Method, *, kernel=None, **parameters) -> FrameRenderer:
    """Prepare the stages of a frame.

    Parameters
    ----------
    scene
        From `realtime.scene.read_scene.read_scene`.
    method
        A real-time method.
    kernel
        An airlight kernel function; needed where `method.uses_kernel` says so.
    parameters
        Values of the method's parameters; the others have its defaults.

    Raises
    ------
    InputError
        For a parameter that the method does not have, where a kernel is missing, and for what method or kernel refuse;
        what the kernel of a method that is not frozen refuses comes with the first frame.
    """
    chosen = read_parameters(method.name, method.parameters, parameters)
    if method.uses_kernel(chosen) and kernel is None:
        raise InputError(f"method {method.name}: got no kernel, wanted one of realtime.kernels.registry.KERNELS")
    by_rays = method.by_rays is not None and method.by_rays(chosen)
    tolerance = chosen.tolerance if method.by_rays else 0.0
    features, camera = scene.features, scene.camera
    provides_visibility = method.provides_visibility(chosen)
    pixel = mi.UInt32(tiled_pixels(camera.width, camera.height))
    corners = tile_corners(pixel, camera, tolerance, by_rays=by_rays, lights=len(scene.lights))
    surface, shade, shade_casts_rays = surface_stages(scene, provides_visibility=provides_visibility)
    tables = prepare_kernel(kernel, type(camera.origin.x)) if method.uses_kernel(chosen) else None

    def sort(pixel, camera, medium, lights, state, distance):
        assert method.cull is not None
        shown = {"features": features, "geometry": None, "medium": medium, "lights": lights}
        return method.cull(frame_view(camera, pixel, distance, **shown), state, chosen)

    carries = method.carries(chosen)

    def run(geometry, pixel, camera, medium, lights, state, lists, distance, by_light, tables, corners=None, last=None):
        shown = {"features": features, "geometry": geometry, "medium": medium, "lights": lights}
        view = frame_view(camera, pixel, distance, **shown)
        if carries:
            view = replace(view, carried=last)
        if provides_visibility:
            view = replace(view, surfaces=by_light)

        def layers_of(view):
            return method.render(view, state, lists, kernel=with_tables(kernel, tables), parameters=chosen)

        layers = layers_of(view) if corners is None else adaptive_layers(layers_of, view, corners, tolerance)
        if not carries:
            return layers if method.passes else composed(layers, by_light)
        carried, layers = layers.carried, replace(layers, carried=None)
        return (layers if method.passes else composed(layers, by_light)), carried

    # Every scene runs it: it checks the parameters also where nothing casts a shadow.
    prepare = method.prepare(scene, chosen) if method.prepare else _no_state
    if not features.shadows:
        prepare = _no_state
    cull = sort if method.cull and features.shadows else _no_lists
    casts_rays = method.casts_rays(chosen)
    render: Callable[..., Any] = run
    passes: Callable[..., Any] | None = None
    if method.passes:
        passes = image_passes(method, chosen, surfaces=features.surfaces)
    if method.frozen(chosen):
        # Trace one tile without launching anything: what the method refuses must not be raised while a frozen function
        # is being recorded, which Dr.Jit 1.5 answers by aborting a later recording.
        few = mi.UInt32(np.array(pixel)[:TILE])
        shown = few, camera, scene.medium, scene.lights
        near = dr.full(type(camera.origin.x), 1, dr.width(few))
        state = prepare(scene)
        lists = cull(*shown, state, near)
        dark = no_surface(None, None, *shown, None)
        run(scene.geometry if casts_rays else None, *shown, state, lists, near, dark, tables)
        render = Frozen(run)
        cull = Frozen(sort) if cull is sort else cull
        passes = passes and Frozen(passes)
    lane = None
    if passes is not None:
        lane = mi.UInt32(np.argsort(np.array(pixel)).astype(np.uint32))
    dr.eval(pixel, lane)
    return FrameRenderer(
        scene,
        method,
        pixel,
        prepare,
        surface=surface,
        shade=shade,
        cull=cull,
        render=render,
        passes=passes,
        tables=tables,
        corners=corners,
        lane=lane,
        shade_casts_rays=shade_casts_rays,
        casts_rays=casts_rays,
        carries=carries,
    )


def render_frame(renderer: FrameRenderer) -> Frame:
    """Render one frame and bring it to the host in the order of the image."""
    return image_frame(renderer, run_stages(renderer, renderer.prepare(renderer.scene)))


def image_frame(renderer: FrameRenderer, stages) -> Frame:
    """Bring `stages`, what `run_stages` returned, to the host in the order of the image."""
    distance, surface, airlight = stages
    height, width = renderer.scene.camera.height, renderer.scene.camera.width
    light = _image(renderer, airlight, (height, width, 3))
    frame = Frame(
        light,
        _image(renderer, surface, (height, width, 3)),
        _image(renderer, distance, (height, width)),
    )
    if renderer.method.check is not None:
        renderer.method.check(light)
    check_radiance(renderer.scene, renderer.method.name, frame.airlight, frame.surface, frame.distance)
    return frame


def run_stages(renderer: FrameRenderer, state):
    """Run the stages on the device and return distance, surface and airlight, evaluated, in the order of the lanes."""
    cast, by_light = run_cast_and_shade(renderer)
    return evaluated(cast, by_light, run_method(renderer, state, cast, by_light))


def evaluated(cast: Cast, by_light, layers):
    """Return distance [m], surface and airlight [W/(m^2 sr)], evaluated, from `cast`, `by_light` and `layers`.

    These are what the stages returned; a colour by light is the surface where the layers have none of their own.
    """
    airlight, behind = layers[:2]
    surface = by_light[0] if behind is None else behind
    dr.eval(cast.distance, surface, airlight)
    return cast.distance, surface, airlight


def run_cast_and_shade(renderer: FrameRenderer) -> tuple[Cast, Any]:
    """Run the stage of camera rays and lit surface; return what the rays meet, and what `run_shade` returns for it."""
    scene = renderer.scene
    return renderer.surface(scene.geometry, scene.facets, renderer.pixel, scene.camera, scene.medium, scene.lights)


def run_shade(renderer: FrameRenderer, cast: Cast):
    """Run the stage of the lit surface on what was cast for an earlier frame."""
    scene = renderer.scene
    arguments = (scene.facets, renderer.pixel, scene.camera, scene.medium, scene.lights, cast)
    return renderer.shade(renderer.shade_geometry, *arguments)


def run_cull(renderer: FrameRenderer, state, distance: Metres):
    """Run the stage that sorts by tiles, for rays up to a `distance` [m], and return its lists."""
    scene = renderer.scene
    return renderer.cull(renderer.pixel, scene.camera, scene.medium, scene.lights, state, distance)


def run_method(
    renderer: FrameRenderer,
    state,
    cast: Cast,
    by_light,
    lists=None,
    history: History | None = None,
    carried: Any = None,
) -> tuple[PerRay, PerRay | None, History | None, Any]:
    """Run the stages of the method, and return what they do, not evaluated.

    Parameters
    ----------
    renderer, state
        The stages, and what their `prepare` returned.
    cast, by_light
        From `run_cast_and_shade`.
    lists
        From `run_cull`; None to run that too.
    history
        What the last frame returned, for passes; None for the first.
    carried
        What the method handed on from the last frame; None for the first.

    Returns
    -------
    airlight
        In-scattered radiance [W/(m^2 sr)].
    surface
        What is seen through it [W/(m^2 sr)]; None where that is the shaded surface as it is.
    history
        For the next frame; None where the method has no passes.
    carried
        For the next frame; None where the method hands nothing on.
    """
    scene, pixel = renderer.scene, renderer.pixel
    if lists is None:
        lists = run_cull(renderer, state, cast.distance)
    shown = pixel, scene.camera, scene.medium, scene.lights
    inputs = state, lists, cast.distance, by_light, renderer.tables, renderer.corners
    if renderer.carries:
        layers, carried = renderer.render(renderer.geometry, *shown, *inputs, carried)
    else:
        layers = renderer.render(renderer.geometry, *shown, *inputs)
    if renderer.passes is None:
        return *layers, None, carried
    geometry = scene.geometry if scene.facets is None else None
    place = geometry, scene.facets, pixel, renderer.lane, scene.camera, scene.medium
    airlight, surface, layers, g_buffer = renderer.passes(*place, cast, by_light, layers, history)
    return airlight, surface, History(layers, g_buffer, scene.camera), carried


def _no_state(scene: Scene) -> tuple[()]:
    return ()


def _no_lists(*place) -> tuple[()]:
    return ()


def _image(renderer: FrameRenderer, values, shape):
    lanes = np.array(values)
    lanes = lanes.T if lanes.ndim == 2 else lanes
    lanes = np.broadcast_to(lanes, (dr.width(renderer.pixel), *lanes.shape[1:]))  # a constant has one entry
    image = np.empty_like(lanes)
    image[np.array(renderer.pixel)] = lanes
    return image.reshape(shape)
