# SPDX-License-Identifier: BSD-3-Clause
"""A frame: camera rays, the lit surface, what the method sorts by tiles, its layers, and passes over the whole image.

Each stage is one frozen function. Frozen functions (`drjit.freeze`) record their kernels on the first call and replay
them afterwards, so a frame costs its kernels and little else. A method whose arrays change their sizes from frame to
frame cannot be frozen. All that moves (camera, lights, medium, shadow maps) is passed in as opaque arrays. What of a
frame serves the next one too: `realtime.frame.incremental`.

Where there are lights with extent, or many, a renderer has groups of lights (`LightGroups`): those without extent
together where they are few, or each by itself, then each light point by itself. Stages for one light are recorded once
and replayed for all of its structure; their radiance is added up. So the code of a kernel, and the time to compile it,
do not grow with the lights: with five lights and two media in one kernel it had half a million operations, and took a
minute. What the stages of a single group take and return is a tuple by group then: states, surfaces and lists.

A large image of a method that computes each ray by itself is rendered in parts, one after the other (`parts`): what a
frame needs beside the image that it shows is then that of a part. Where the method needs the whole image, its stage is
not frozen if that is large: a replay of Dr.Jit 1.5 frees what it made on its way only at its end, and filters make some
twenty images on theirs.
"""

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.area_lights.points import LightPoints
from realtime.errors import InputError, refusals
from realtime.frame.frame_view import frame_view
from realtime.frame.layers import adaptive_layers, added, composed, image_passes
from realtime.frame.light_on_ray import check_radiance
from realtime.frame.surface import Cast
from realtime.frame.surface_stages import no_surface, surface_stages
from realtime.kernels.preparation import prepare_kernel, with_tables
from realtime.methods.interface.layers import History
from realtime.methods.interface.method import Method, Preparation, method_parameters
from realtime.numerics.aligned import aligned_array
from realtime.numerics.array_types import Metres, PerRay
from realtime.numerics.recorded import Frozen
from realtime.scene.camera import tiled_pixels
from realtime.scene.light_points import with_light_points
from realtime.scene.lights import Light
from realtime.scene.read_scene import Scene
from realtime.tiles.adaptive_sampling import Corners, tile_corners
from realtime.tiles.layout import TILE

_ROOM = 2**30  # of states of groups of lights, such as shadow maps [bytes]
_LARGE = 2**21  # pixels; a larger image is rendered in parts where it can be
_PART = 2**20  # pixels of a part at most
_FEW = 4  # lights without extent whose code one kernel may hold; in bounded media it is long, and only one may
_MOST_KEPT = 32  # groups of lights of which states, surfaces and lists are kept; those of others are made when needed


@dataclass(frozen=True)
class LightGroups:
    """The stages of a frame by groups of lights, for a scene with lights with extent, or with many."""

    light_points: LightPoints
    ordinary: tuple["FrameRenderer", ...]  #: of the lights without extent: one of all of them, or one of each
    of_point: "FrameRenderer | None"  #: of one light point; None where there is none by itself
    at_once: bool = False  #: whether there is one group, of all lights and light points


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
    by_rays: bool  #: whether each ray is computed by itself, so that any part of the image can be rendered alone
    extra_layers: bool  #: whether `render` returns `Layers.extra` too
    groups: LightGroups | None = None  #: where the scene has lights with extent, or many

    # A frozen function reads all shapes of a scene that it is given anew at every call.

    @property
    def shade_geometry(self) -> Any:
        """The Mitsuba scene if shading needs it."""
        return self.scene.geometry if self.shade_casts_rays else None

    @property
    def geometry(self) -> Any:
        """The Mitsuba scene if the method needs it."""
        return self.scene.geometry if self.casts_rays else None

    @property
    def lights(self) -> tuple[Light, ...]:
        """The lights for recorded functions: a light point by itself is of no light, as one recording serves all."""
        lights = self.scene.lights
        return (replace(lights[0], source=0),) if len(lights) == 1 and lights[0].source else lights


@dataclass(frozen=True)
class Frame:
    """What a frame shows, as float arrays of shape (height, width[, 3])."""

    airlight: Any  #: in-scattered radiance [W/(m^2 sr)]
    surface: Any  #: radiance of the lit surface through the medium [W/(m^2 sr)]
    distance: Any  #: to the visible surface, infinite where there is none [m]
    extra: Mapping[str, Any] = field(default_factory=dict)  #: further layers by their names, colours


def frame_renderer(
    scene: Scene, method: Method, *, kernel=None, extra_layers: bool = False, **parameters
) -> FrameRenderer:
    """Prepare the stages of a frame.

    Parameters
    ----------
    scene
        From `realtime.scene.read_scene.read_scene`.
    method
        A real-time method.
    kernel
        An airlight kernel function; needed where `method.uses_kernel` says so.
    extra_layers
        Whether frames have the further layers that the method names; in a scene with lights with extent they have not.
        In others all lights are in one group then.
    parameters
        Values of the method's parameters, and of `realtime.area_lights.points.LightPoints`; the others have their
        defaults.

    Raises
    ------
    InputError
        For a parameter that the method does not have, where a kernel is missing, and for what method or kernel refuse;
        what the kernel of a method that is not frozen refuses comes with the first frame.
    """
    chosen, light_points = method_parameters(method, parameters)
    if method.uses_kernel(chosen) and kernel is None:
        raise InputError(f"method {method.name}: got no kernel, wanted one of realtime.kernels.registry.KERNELS")
    _check_clouds(scene, method)
    at_once = _has_passes(method, chosen) or method.lights_at_once(chosen) or method.carries(chosen)
    by_light = len(scene.lights) > (1 if scene.features.bounded else _FEW) and not (at_once or extra_layers)
    if not (scene.area_lights or by_light):
        return _stages(scene, method, kernel, chosen, extra_layers=extra_layers)
    lit = with_light_points(scene, light_points.points, light_points.pattern)
    if at_once:
        groups = LightGroups(light_points, (_stages(lit, method, kernel, chosen),), None, at_once=True)
    else:
        of_one: dict[Any, FrameRenderer] = {}

        def stages_of(light: Light) -> FrameRenderer:
            """Return the stages for one light: lights of one structure share them."""
            structure = tuple(value is None for value in vars(light).values())
            if structure not in of_one:
                alone = replace(lit, lights=(light,))
                of_one[structure] = _stages(alone, method, kernel, chosen, adds_up=True)
            return of_one[structure]

        if by_light:
            ordinary = tuple(stages_of(light) for light in scene.lights)
        else:
            ordinary = (_stages(scene, method, kernel, chosen),) if scene.lights else ()
        groups = LightGroups(light_points, ordinary, stages_of(lit.lights[-1]) if scene.area_lights else None)
    known = groups.ordinary[0] if groups.ordinary else groups.of_point
    assert known is not None
    return replace(known, scene=scene, prepare=GroupPreparation(groups), groups=groups)


def _check_clouds(scene: Scene, method: Method) -> None:
    """Refuse clouds and skies where a method does not know them, and where it does what clouds cannot have."""
    features, name = scene.features, method.name
    if not method.renders_clouds:
        if features.uneven:
            raise InputError(
                f"method {name}: the scene has a HeterogeneousMedium, and this method knows homogeneous ones only; use "
                "cloud-collectors or cloud-octaves"
            )
        if features.concave:
            raise InputError(
                f"method {name}: the bounds of the media are not all convex, and these rays cross convex bounds only "
                f"(shapes {', '.join(map(repr, features.concave[:3]))}); use cloud-collectors or cloud-octaves, or cut "
                "the shapes into convex parts"
            )
        if features.sky:
            raise InputError(
                f"method {name}: the scene has a sky, an emitter of type 'constant', which this method does not know; "
                "use cloud-collectors or cloud-octaves, or remove it"
            )
        return
    if scene.medium.clouds is None:
        raise InputError(
            f"method {name}: the scene has no clouds; wanted media with closed bounds in clear air: give the medium "
            "bounds, or use another method"
        )
    kinds = [light.kind for light in scene.lights if light.w] + [f"area ({light.kind})" for light in scene.area_lights]
    if kinds:
        raise InputError(
            f"method {name}: the scene has a light of kind {kinds[0]}, and clouds are lit from infinity; wanted "
            "emitters of type 'directional', and at most one 'constant': replace it or remove it"
        )


def _stages(
    scene: Scene, method: Method, kernel: Any, chosen: Any, *, adds_up: bool = False, extra_layers: bool = False
) -> FrameRenderer:
    """Return the stages for the lights of a scene; with `adds_up`, what they render is added to what was before."""
    by_rays = method.by_rays is not None and method.by_rays(chosen)
    tolerance = chosen.tolerance if method.by_rays else 0.0
    features, camera = scene.features, scene.camera
    provides_visibility = method.provides_visibility(chosen)
    pixel = aligned_array(mi.UInt32, tiled_pixels(camera.width, camera.height))
    corners = tile_corners(pixel, camera, tolerance, by_rays=by_rays, lights=len(scene.lights))
    stages = surface_stages(
        scene,
        provides_visibility=provides_visibility,
        by_source=method.by_source(chosen),
        through_media=not method.renders_clouds,
    )
    surface, shade, shade_casts_rays = stages
    has_passes = _has_passes(method, chosen)
    tables = prepare_kernel(kernel, type(camera.origin.x)) if method.uses_kernel(chosen) else None

    def sort(pixel, camera, medium, lights, state, distance):
        assert method.cull is not None
        shown = {"features": features, "geometry": None, "medium": medium, "lights": lights}
        return method.cull(frame_view(camera, pixel, distance, **shown), state, chosen)

    carries = method.carries(chosen)

    def run(
        geometry,
        pixel,
        camera,
        medium,
        lights,
        state,
        lists,
        distance,
        by_light,
        tables,
        corners=None,
        sums=None,
        last=None,
    ):
        shown = {"features": features, "geometry": geometry, "medium": medium, "lights": lights}
        view = frame_view(camera, pixel, distance, **shown)
        if carries:
            view = replace(view, carried=last)
        if provides_visibility:
            view = replace(view, surfaces=by_light)

        if extra_layers:
            view = replace(view, extra_layers=True)

        def layers_of(view):
            with refusals():
                layers = method.render(view, state, lists, kernel=with_tables(kernel, tables), parameters=chosen)
            return layers if extra_layers else replace(layers, extra=None)

        layers = layers_of(view) if corners is None else adaptive_layers(layers_of, view, corners, tolerance)
        extra, layers = layers.extra, replace(layers, extra=None)
        if carries:
            carried, layers = layers.carried, replace(layers, carried=None)
            returned: Any = ((layers if has_passes else composed(layers, by_light)), carried)
        elif has_passes:
            returned = layers
        else:
            returned = composed(layers, by_light) if sums is None else added(sums, layers, by_light)
        return (returned, extra) if extra_layers else returned

    prepare = method.prepare(scene, chosen) if method.prepare else _no_state
    cull = sort if method.cull and features.shadows else _no_lists
    casts_rays = method.casts_rays(chosen)
    render: Callable[..., Any] = run
    passes: Callable[..., Any] | None = None
    if has_passes:
        passes = image_passes(method, chosen, surfaces=features.surfaces)
    in_parts = by_rays and not has_passes and not carries and corners is None
    if method.frozen(chosen) and (in_parts or camera.width * camera.height <= _LARGE):
        # Trace one tile without launching anything: what the method refuses must not be raised while a frozen function
        # is being recorded, which Dr.Jit 1.5 answers by aborting a later recording.
        few = mi.UInt32(np.array(pixel)[:TILE])
        shown = few, camera, scene.medium, scene.lights
        near = dr.full(type(camera.origin.x), 1, dr.width(few))
        state = prepare(scene)
        lists = cull(*shown, state, near)
        dark = no_surface(None, None, *shown, None)
        sums = no_light(scene, dr.width(few)) if adds_up else None
        run(scene.geometry if casts_rays else None, *shown, state, lists, near, dark, tables, sums=sums)
        render = Frozen(run)
        cull = Frozen(sort) if cull is sort else cull
        passes = passes and Frozen(passes)
    lane = None
    if passes is not None:
        lane = aligned_array(mi.UInt32, np.argsort(np.array(pixel)).astype(np.uint32))
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
        by_rays=in_parts,
        extra_layers=extra_layers,
    )


def _has_passes(method: Method, parameters: Any) -> bool:
    return bool(method.passes) and method.runs_passes(parameters)


def render_frame(renderer: FrameRenderer) -> Frame:
    """Render one frame and bring it to the host in the order of the image."""
    state, frame = renderer.prepare(renderer.scene), None
    for part in parts(renderer):
        cast, by_light = run_cast_and_shade(part)
        if is_large(renderer):
            cast = read_by_method(part, cast)
        layers = run_method(part, state, cast, by_light)
        stages, extra = evaluated(cast, by_light, layers), layers[2]
        del cast, by_light, layers
        give_memory_back(renderer)  # the host's images need room now
        frame = frame_with_part(frame, part, stages, extra)
    assert frame is not None
    check_radiance(renderer.scene, renderer.method.name, frame.airlight, frame.surface, frame.distance)
    return frame


def is_large(renderer: FrameRenderer) -> bool:
    """Return whether the image has so many pixels that a frame saves memory."""
    return dr.width(renderer.pixel) > _LARGE


def give_memory_back(renderer: FrameRenderer) -> None:
    """Free what a large frame left and nobody reads: a view and its functions hold one another."""
    if is_large(renderer):
        gc.collect()
        dr.flush_malloc_cache()


def parts(renderer: FrameRenderer) -> tuple[FrameRenderer, ...]:
    """Return renderers of the parts of a large image, of about one size each; the renderer itself where that is all."""
    count = dr.width(renderer.pixel)
    if not (renderer.by_rays and is_large(renderer)):
        return (renderer,)
    block = TILE * TILE
    length = -(-count // (-(-count // _PART) * block)) * block
    lanes = [dr.arange(mi.UInt32, begin, min(begin + length, count)) for begin in range(0, count, length)]
    pixels = [dr.gather(mi.UInt32, renderer.pixel, lane) for lane in lanes]
    dr.eval(pixels)
    return tuple(_of_pixels(renderer, pixel) for pixel in pixels)


def _of_pixels(renderer: FrameRenderer, pixel: PerRay) -> FrameRenderer:
    """Return a renderer of some pixels."""
    groups = renderer.groups
    if groups is not None:
        ordinary = tuple(replace(each, pixel=pixel) for each in groups.ordinary)
        of_point = groups.of_point and replace(groups.of_point, pixel=pixel)
        groups = replace(groups, ordinary=ordinary, of_point=of_point)
    return replace(renderer, pixel=pixel, groups=groups)


def image_frame(renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None = None) -> Frame:
    """Bring `stages`, what `run_stages` returned, to the host in the order of the image, and `extra` layers."""
    frame = unchecked_frame(renderer, stages, extra)
    check_radiance(renderer.scene, renderer.method.name, frame.airlight, frame.surface, frame.distance)
    return frame


def unchecked_frame(renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None = None) -> Frame:
    """Do what `image_frame` does, and return radiance that is not finite too, for whoever counts it."""
    return frame_with_part(None, renderer, stages, extra)


def frame_with_part(frame: Frame | None, renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None) -> Frame:
    """Return a frame with the pixels of a renderer written into it; a new one where there is none yet."""
    distance, surface, airlight = stages
    shown = {name: _colour(renderer, values) for name, values in (extra or {}).items()}
    return Frame(
        _image(renderer, airlight, frame and frame.airlight),
        _image(renderer, surface, frame and frame.surface),
        _image(renderer, distance, frame and frame.distance),
        {name: _image(renderer, values, frame and frame.extra[name]) for name, values in shown.items()},
    )


def run_stages(renderer: FrameRenderer, state):
    """Run the stages on the device and return distance, surface and airlight, evaluated, in the order of the lanes."""
    cast, by_light = run_cast_and_shade(renderer)
    return evaluated(cast, by_light, run_method(renderer, state, cast, by_light))


def evaluated(cast: Cast, by_light, layers):
    """Return distance [m], surface and airlight [W/(m^2 sr)], evaluated, from `cast`, `by_light` and `layers`.

    These are what the stages returned; a colour by light is the surface where the layers have none of their own.
    """
    airlight, behind, *more = layers[:3]
    surface = by_light[0] if behind is None else behind
    dr.eval(cast.distance, surface, airlight, more)
    return cast.distance, surface, airlight


@dataclass(frozen=True)
class GroupPreparation:
    """What makes the states of groups of lights; called with the scene as it is now, returns them in a tuple."""

    groups: LightGroups

    def __call__(self, scene: Scene) -> tuple[Any, ...]:
        """Return the state of each group, None for those that are not kept."""
        states: list[Any] = []
        for group in _groups_in(self.groups, scene):
            kept = not states or len(states) < kept_groups(states[0])
            states.append(group.prepare(group.scene) if kept else None)
        return tuple(states)


def kept_groups(state: Any) -> int:
    """Return of how many groups of lights states like this are kept: not more than fill the room for them."""
    return min(_MOST_KEPT, max(1, _ROOM // max(bytes_in(state), 1)))


def bytes_in(value: Any) -> int:
    """Return the size of the Dr.Jit arrays in a state [bytes]."""
    if isinstance(value, tuple | list):
        return sum(bytes_in(item) for item in value)
    if is_dataclass(value):
        return sum(bytes_in(item) for item in vars(value).values())
    if not dr.is_array_v(value):
        return 0
    return sum(map(bytes_in, value)) if dr.depth_v(value) > 1 else dr.width(value) * dr.itemsize_v(value)


def light_groups(renderer: FrameRenderer) -> tuple[FrameRenderer, ...]:
    """Return a renderer for each group of lights; a renderer without lights with extent itself."""
    return (renderer,) if renderer.groups is None else _groups_in(renderer.groups, renderer.scene)


def _groups_in(groups: LightGroups, scene: Scene) -> tuple[FrameRenderer, ...]:
    lit = with_light_points(scene, groups.light_points.points, groups.light_points.pattern)
    if groups.at_once:
        return (replace(groups.ordinary[0], scene=lit),)
    shown = [scene]  # lights without extent, by group
    if len(groups.ordinary) > 1:
        shown = [replace(scene, lights=(light,)) for light in scene.lights]
    ordinary = tuple(replace(each, scene=part) for each, part in zip(groups.ordinary, shown))
    if groups.of_point is None:
        return ordinary
    of_point = groups.of_point
    points = (replace(lit, lights=(point,)) for point in lit.lights[len(scene.lights) :])
    return ordinary + tuple(replace(of_point, scene=point) for point in points)


def run_cast_and_shade(renderer: FrameRenderer) -> tuple[Cast, Any]:
    """Run the stage of camera rays and lit surface; return what the rays meet, and what `run_shade` returns for it."""
    if renderer.groups is not None:
        first, *others = light_groups(renderer)
        cast, by_light = run_cast_and_shade(first)
        return cast, (by_light, *_shaded(others, cast, 1))
    scene = renderer.scene
    return renderer.surface(scene.geometry, scene.facets, renderer.pixel, scene.camera, scene.medium, renderer.lights)


def read_by_method(renderer: FrameRenderer, cast: Cast) -> Cast:
    """Return of what camera rays meet what the method reads; a frame that shades it again needs all."""
    one_by_one = renderer.groups is not None and not renderer.groups.at_once
    reads_surfaces = renderer.passes is not None and not renderer.method.passes_read_depth_alone
    return cast if one_by_one or reads_surfaces else Cast(cast.distance)


def run_shade(renderer: FrameRenderer, cast: Cast):
    """Run the stage of the lit surface on what was cast for an earlier frame."""
    if renderer.groups is not None:
        return _shaded(light_groups(renderer), cast, 0)
    scene = renderer.scene
    arguments = (scene.facets, renderer.pixel, scene.camera, scene.medium, renderer.lights, cast)
    return renderer.shade(renderer.shade_geometry, *arguments)


def _shaded(groups: Sequence[FrameRenderer], cast: Cast, before: int) -> tuple[Any, ...]:
    """Return the surfaces of groups of lights, of which some came `before`; None for those that are not kept."""
    kept = max(_MOST_KEPT - before, 0)
    return tuple(run_shade(group, cast) if number < kept else None for number, group in enumerate(groups))


def run_cull(renderer: FrameRenderer, state, distance: Metres):
    """Run the stage that sorts by tiles, for rays up to a `distance` [m], and return its lists."""
    if renderer.groups is not None:
        groups = light_groups(renderer)
        states = state or renderer.prepare(renderer.scene)
        return tuple(
            None if own is None else run_cull(group, own, distance) for group, own in zip(groups, states, strict=True)
        )
    scene = renderer.scene
    return renderer.cull(renderer.pixel, scene.camera, scene.medium, renderer.lights, state, distance)


def run_method(
    renderer: FrameRenderer,
    state,
    cast: Cast,
    by_light,
    lists=None,
    history: History | None = None,
    carried: Any = None,
) -> tuple[PerRay, PerRay | None, Mapping[str, PerRay] | None, History | None, Any]:
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
    extra
        Further layers by their names; None where nobody asks for them.
    history
        For the next frame; None where the method has no passes.
    carried
        For the next frame; None where the method hands nothing on.
    """
    if renderer.groups is not None:
        groups = light_groups(renderer)
        if renderer.groups.at_once:
            only = None if lists is None else lists[0]
            own = state[0] if state else groups[0].prepare(groups[0].scene)
            airlight, surface, *left = run_method(groups[0], own, cast, by_light[0], only, history, carried)
            return airlight, by_light[0][0] if surface is None else surface, *left
        return *_summed(groups, state, cast, by_light, lists), None, None, None
    scene, pixel = renderer.scene, renderer.pixel
    if lists is None:
        lists = run_cull(renderer, state, cast.distance)
    shown = pixel, scene.camera, scene.medium, renderer.lights
    inputs = state, lists, cast.distance, by_light, renderer.tables, renderer.corners
    last = (None, carried) if renderer.carries else ()
    layers, extra = renderer.render(renderer.geometry, *shown, *inputs, *last), None
    if renderer.extra_layers:
        layers, extra = layers
    if renderer.carries:
        layers, carried = layers
    if renderer.passes is None:
        return *layers, extra, None, carried
    geometry = scene.geometry if scene.facets is None else None
    place = geometry, scene.facets, pixel, renderer.lane, scene.camera, scene.medium
    airlight, surface, layers, g_buffer = renderer.passes(*place, cast, by_light, layers, history)
    return airlight, surface, extra, History(layers, g_buffer, scene.camera), carried


def _summed(groups: Sequence[FrameRenderer], states, cast: Cast, by_light, lists) -> tuple[PerRay, PerRay]:
    """Return airlight and surface of all groups of lights."""
    sums, beyond = no_light(groups[0].scene, dr.width(cast.distance)), None
    for number, group in enumerate(groups):
        shaded = by_light[number] if by_light[number] is not None else run_shade(group, cast)
        state = states[number] if states and states[number] is not None else group.prepare(group.scene)
        own = lists[number] if lists is not None and lists[number] is not None else None
        if own is None:
            own = run_cull(group, state, cast.distance)
        sums, more = run_group(group, sums, state, own, cast, shaded)
        if number == 0:
            beyond = more
    airlight, surface = sums
    return airlight, surface if beyond is None else surface + beyond


def run_group(
    renderer: FrameRenderer, sums: tuple[PerRay, PerRay], state, lists, cast: Cast, by_light
) -> tuple[tuple[PerRay, PerRay], PerRay | None]:
    """Run the method for one group of lights.

    Parameters
    ----------
    renderer
        Of `light_groups`.
    sums
        Airlight and surface of the groups before it [W/(m^2 sr)].
    state, lists, cast, by_light
        See `run_method`.

    Returns
    -------
    sums
        With this group's, evaluated.
    beyond
        What is seen behind all media, of no light; None where there is nothing.
    """
    scene = renderer.scene
    shown = renderer.pixel, scene.camera, scene.medium, renderer.lights
    inputs = state, lists, cast.distance, by_light, renderer.tables, renderer.corners
    airlight, surface, beyond = renderer.render(renderer.geometry, *shown, *inputs, sums)
    dr.eval(airlight, surface, beyond)
    return (airlight, surface), beyond


def no_light(scene: Scene, width: int) -> tuple[PerRay, PerRay]:
    """Return airlight and surface without any light, for `width` rays."""
    airlight, surface = (dr.zeros(type(scene.medium.albedo), width) for _ in range(2))
    dr.make_opaque(airlight, surface)
    return airlight, surface


def _no_state(scene: Scene) -> tuple[()]:
    return ()


def _no_lists(*place) -> tuple[()]:
    return ()


def _colour(renderer: FrameRenderer, values):
    """Return a layer as a colour: a number is grey."""
    Color = type(renderer.scene.medium.albedo)
    return values if isinstance(values, Color) else Color(values)


def _image(renderer: FrameRenderer, values, image=None):
    """Write values by lane to their pixels of an image (height, width[, 3]), a new one by default, and return it."""
    camera, pixel = renderer.scene.camera, np.array(renderer.pixel)
    channels = [np.array(channel) for channel in values] if dr.depth_v(values) > 1 else [np.array(values)]
    if image is None:
        image = np.empty((camera.height, camera.width, len(channels)), dtype=channels[0].dtype)
        image = image if dr.depth_v(values) > 1 else image[..., 0]
    by_pixel = image.reshape(-1, len(channels))
    for number, channel in enumerate(channels):
        by_pixel[pixel, number] = channel
    return image
