# SPDX-License-Identifier: BSD-3-Clause
"""A frame: camera rays, the lit surface, and the airlight of a method, by groups of
lights and parts of the image.

A frame is a list of groups of lights times a list of parts of the image. Each group is run by
recorded functions (`drjit.freeze`), which record their kernels on the first call and replay them
afterwards, so that a frame costs its kernels and little else; groups are added up and parts joined.
A method whose arrays change their sizes from frame to frame is not frozen. All that moves (camera,
lights, medium, shadow maps) is passed in as opaque arrays. `realtime.frame.incremental` says what
the next frame uses again.

Lights are tables (`realtime.scene.light_table`), one for each structure and area light. A method
that looks at all lights together has one group of all tables; one that has no state sums a table in
one loop, and a table is a group. Every other method has a group for each light, a table of one row,
and lights of one structure share a recording: neither the code of a kernel nor the time to compile
it grows with the lights. Surfaces are shaded by whole tables, in one loop over lights, except where
the method says which of its lights reaches them.

Parts: a large image of a method that computes each ray by itself is rendered in parts, one after
the other: the intermediate arrays are then as large as a part. Where the method needs the whole
image, its stage is not frozen if the image is large: a replay of Dr.Jit 1.5 frees intermediate
arrays only at its end, and filters make some twenty intermediate images.
"""

import gc
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, is_dataclass, replace
from functools import cached_property, reduce
from operator import add
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.area_lights.points import LightSamples
from airlight.realtime.frame.history import HistoryPass
from airlight.realtime.frame.light_on_ray import check_radiance
from airlight.realtime.frame.sphere_lights import sampled_sphere, sphere_scales
from airlight.realtime.frame.surface import Cast, surface_stages
from airlight.realtime.kernels.registry import Kernel
from airlight.realtime.methods.interface.media_checks import check_media
from airlight.realtime.methods.interface.method import (
    Layers,
    Method,
    Preparation,
    camera_view,
    method_parameters,
)
from airlight.realtime.numerics.array_types import PerRay, aligned_array
from airlight.realtime.numerics.noise import Noise, blue_mask
from airlight.realtime.numerics.recorded import Frozen, refusals
from airlight.realtime.parameters import values
from airlight.realtime.scene.camera import TILE, tiled_pixels
from airlight.realtime.scene.light_table import (
    LightTable,
    alike,
    light_samples,
    light_tables,
    structure,
)
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.read_scene import Scene

# of states of groups of lights, such as shadow maps, and as much of surfaces by group [bytes]
_ROOM = 2**30
_LARGE = 2**21  # pixels; a larger image is rendered in parts where it can be
_PART = 2**20  # pixels of a part at most


@dataclass(frozen=True)
class Stages:
    """The recorded functions of a frame; each is recorded once for each structure of lights."""

    prepare: Preparation  #: scene -> the state of the method: shadow maps, shadow planes
    surface: Callable[..., Any]  #: -> what camera rays meet, and what `shade` returns for it
    #: -> surface radiance: by light where the method knows their visibility, or a sum
    shade: Callable[..., Any]
    render: Callable[..., Any]  #: -> what `_composed` returns
    shade_casts_rays: bool  #: whether shading asks Mitsuba for shapes or shadows


@dataclass(frozen=True)
class LightGroup:
    """The lights of a scene that a method renders together."""

    scene: Scene  #: with these lights alone

    @property
    def source(self) -> int | None:
        """The number of the area light of whose samples the group is; None for other lights."""
        return self.scene.lights[0].source if self.scene.lights else None

    @cached_property
    def tables(self) -> tuple[LightTable, ...]:
        """The lights for recorded functions; a table by itself is of area light 0, as
        one recording serves all.
        """
        tables = light_tables(self.scene.lights)
        if len(tables) == 1 and self.source:
            tables = (replace(tables[0], rows=replace(tables[0].rows, source=0)),)
        return tables


@dataclass(frozen=True)
class FrameRenderer:
    """The frames of one scene with one method, ready to be rendered any number of times."""

    scene: Scene
    method: Method
    light_samples: LightSamples
    pixel: PerRay  #: pixel numbers in the order of the lanes
    stages: Stages
    kernel: Any  #: with the tables that it reads; None where the method uses none
    extra_layers: bool  #: whether frames have the further layers that the method names
    sphere_scales: Frozen | None  #: by what samples of sphere lights are scaled
    history: HistoryPass | None  #: takes the mean with the frames before
    mask: Any = None  #: of blue noise, for a noisy method
    #: number of the run: a noisy method draws other random numbers in each, below 2^32
    run: int = 0
    frame: int = 0  #: number of the frame in its run, below 2^32

    @property
    def by_rays(self) -> bool:
        """Whether any part of the image can be rendered alone."""
        return _by_rays(self.method)

    @cached_property
    def lights(self) -> tuple[Light, ...]:
        """The lights of the scene as it is now and the samples of its area
        lights, made once for a frame.
        """
        return self.scene.lights + light_samples(
            self.scene, self.light_samples.points, self.light_samples.pattern
        )

    @cached_property
    def groups(self) -> tuple[LightGroup, ...]:
        """The groups of lights of the scene as it is now."""
        return light_groups(self.scene, self.lights, self.method, together=self.extra_layers)

    @cached_property
    def shaded(self) -> tuple[tuple[LightTable, ...], ...]:
        """The tables of lights by which surfaces are shaded: those of the groups where
        visibility is the method's.
        """
        if self.method.provides_visibility:
            return tuple(group.tables for group in self.groups)
        return (light_tables(self.lights),)

    def prepare(self, scene: Scene) -> tuple[Any, ...]:
        """Return the state of the method by groups of lights, None for those that are not kept."""
        renderer = self if scene is self.scene else replace(self, scene=scene)
        states: list[Any] = []
        for group in renderer.groups:
            kept = not states or len(states) < kept_groups(states[0])
            states.append(self.stages.prepare(group.scene) if kept else None)
        return tuple(states)


@dataclass(frozen=True)
class Frame:
    """A rendered frame, as float arrays of shape (height, width[, 3])."""

    airlight: Any  #: in-scattered radiance [W/(m^2 sr)]
    surface: Any  #: radiance of the lit surface through the medium [W/(m^2 sr)]
    distance: Any  #: to the visible surface, infinite where there is none [m]
    #: further layers by their names, colours
    extra: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Rendered:
    """The result of a method, in the order of the lanes, not evaluated."""

    airlight: PerRay  #: in-scattered radiance [W/(m^2 sr)]
    #: radiance of the surface through it [W/(m^2 sr)]; None where another group has it
    surface: PerRay | None
    extra: Mapping[str, PerRay] | None = None  #: further layers by their names
    carried: Any = None  #: for the next frame


def frame_renderer(
    scene: Scene,
    method: type[Method],
    *,
    kernel: Kernel | None = None,
    extra_layers: bool = False,
    **parameters,
) -> FrameRenderer:
    """Prepare the stages of a frame.

    `scene`: from `realtime.scene.read_scene.read_scene`; `method`: a real-time method; `kernel`: an
    airlight kernel; needed where `method.uses_kernel` says so; `extra_layers`: whether frames have
    the further layers that the method names, which puts all lights into one group; never in a scene
    with area lights; `parameters`: values of the method's parameters, and of
    `realtime.area_lights.points.LightSamples`; the others have their defaults. Raises InputError
    for a parameter that the method does not have, a missing kernel, and a scene that the method
    refuses; refusals that depend on the rays come with the first frame.
    """
    chosen, samples = method_parameters(method, parameters)
    if chosen.uses_kernel and kernel is None:
        raise InputError(
            f"method {method.name}: got no kernel, expected one of "
            "realtime.kernels.registry.KERNELS"
        )
    check_media(scene, chosen)
    extra_layers &= not scene.area_lights
    # Groups of one structure need the same memory and are refused alike.
    lights = scene.lights + light_samples(scene, samples.points, samples.pattern)
    groups = light_groups(scene, lights, chosen, together=extra_layers)
    for group in {
        tuple(structure(light)[1] for light in each.scene.lights): each for each in groups
    }.values():
        chosen.check(group.scene)
    pixel = aligned_array(mi.UInt32, tiled_pixels(scene.camera.width, scene.camera.height))
    dr.eval(pixel)
    return FrameRenderer(
        scene,
        chosen,
        samples,
        pixel,
        stages=_stages(scene, chosen, extra_layers=extra_layers),
        kernel=kernel.prepared(type(scene.camera.origin.x))
        if chosen.uses_kernel and kernel
        else None,
        extra_layers=extra_layers,
        sphere_scales=sphere_scales(scene, chosen),
        history=HistoryPass(**values(chosen.history), Float=type(scene.camera.origin.x))
        if chosen.history
        else None,
        mask=blue_mask() if chosen.noisy else None,
    )


def light_groups(
    scene: Scene, lights: tuple[Light, ...], method: Method, *, together: bool
) -> tuple[LightGroup, ...]:
    """Return the groups of some lights of a scene: all together, those that
    are alike, or one by one.
    """
    if method.at_once or together:
        groups = [lights]
    elif method.by_table:
        groups = alike(lights)
    else:
        groups = [(light,) for light in lights]
    return tuple(LightGroup(replace(scene, lights=group)) for group in groups)


def _stages(scene: Scene, method: Method, *, extra_layers: bool) -> Stages:
    """Return the recorded functions of a frame."""
    features = scene.features
    surface, shade, shade_casts_rays = surface_stages(
        scene,
        provides_visibility=method.provides_visibility,
        by_source=method.by_source,
        through_media=not method.renders_clouds,
    )

    def run(
        geometry,
        pixel,
        camera,
        medium,
        tables,
        state,
        distance,
        by_light,
        kernel,
        first,
        last=None,
        noise=None,
    ):
        view = camera_view(
            camera, pixel, distance, features=features, scene=geometry, medium=medium, tables=tables
        )
        view = replace(view, carried=last, noise=noise, extra_layers=extra_layers)
        if method.provides_visibility:
            view = replace(view, surfaces=by_light)
        with refusals():
            layers = method.render(view, state, kernel)
        return _composed(
            layers if extra_layers else replace(layers, extra=None), by_light, first=first
        )

    large = scene.camera.width * scene.camera.height > _LARGE
    frozen = method.frozen and (_by_rays(method) or not large)
    return Stages(
        method.preparation(scene), surface, shade, Frozen(run) if frozen else run, shade_casts_rays
    )


def _by_rays(method: Method) -> bool:
    return method.by_rays and not method.carries and method.history is None


def _composed(layers: Layers, by_light: tuple[PerRay, ...], *, first: bool):
    """Return a frame from layers, by the formula of `realtime.methods.interface.method`.

    `layers`: of a method; `by_light`: the radiance of the surfaces by light where the layers have a
    visibility, otherwise their sum alone, or nothing for a further group; `first`: whether this is
    the first group of lights, which shows what is of no light. Returns `airlight`, `surface`:
    in-scattered radiance, and that from behind it [W/(m^2 sr)]; None where that is nothing but the
    shaded surface; `extra`, `carried`: as the layers have them.
    """
    parts = list(by_light)
    if layers.visibility is not None:
        parts = [
            _lit(fraction, color)
            for fraction, color in zip(layers.visibility, by_light, strict=True)
        ]
    if first and layers.background is not None:
        parts.append(layers.background)
    surface = _sum(tuple(parts)) if parts else None
    if surface is not None and layers.transmittance is not None:
        surface = layers.transmittance * surface
    changed = (
        len(parts) != len(by_light)
        or layers.visibility is not None
        or layers.transmittance is not None
    )
    return layers.in_scattered, surface if changed else None, layers.extra, layers.carried


def _sum(colors: tuple[PerRay, ...]) -> PerRay:
    """Return the sum of some colours, a single one as it is."""
    return reduce(add, colors)


def _lit(fraction: PerRay, color: PerRay) -> PerRay:
    return (
        dr.select(fraction, color, 0)
        if isinstance(fraction, bool) or dr.is_mask_v(fraction)
        else fraction * color
    )


def render_frame(renderer: FrameRenderer) -> Frame:
    """Render one frame and bring it to the host in the order of the image."""
    state, frame = renderer.prepare(renderer.scene), None
    for part in parts(renderer):
        cast, by_light = run_cast_and_shade(part)
        if is_large(renderer) and not renderer.method.provides_visibility:
            cast = Cast(cast.distance)  # nothing is shaded any more
        rendered = run_method(part, state, cast, by_light)
        stages, extra = evaluated(cast, rendered), rendered.extra
        del cast, by_light, rendered
        give_memory_back(renderer)  # the host's images need room now
        frame = frame_with_part(frame, part, stages, extra)
    assert frame is not None
    check_radiance(
        renderer.scene, renderer.method.name, frame.airlight, frame.surface, frame.distance
    )
    return frame


def is_large(renderer: FrameRenderer) -> bool:
    """Return whether the image has so many pixels that a frame saves memory."""
    return dr.width(renderer.pixel) > _LARGE


def give_memory_back(renderer: FrameRenderer) -> None:
    """Free what a large frame left and nobody reads."""
    if is_large(renderer):
        gc.collect()
        dr.flush_malloc_cache()


def parts(renderer: FrameRenderer) -> tuple[FrameRenderer, ...]:
    """Return renderers of the parts of a large image, of about one size each; the renderer
    itself where that is all.
    """
    count = dr.width(renderer.pixel)
    if not (renderer.by_rays and is_large(renderer)):
        return (renderer,)
    block = TILE * TILE
    length = -(-count // (-(-count // _PART) * block)) * block
    lanes = [
        dr.arange(mi.UInt32, begin, min(begin + length, count)) for begin in range(0, count, length)
    ]
    pixels = [dr.gather(mi.UInt32, renderer.pixel, lane) for lane in lanes]
    dr.eval(pixels)
    return tuple(replace(renderer, pixel=pixel) for pixel in pixels)


def run_stages(renderer: FrameRenderer, state):
    """Run the stages on the device and return distance, surface and airlight, evaluated,
    in the order of the lanes.
    """
    cast, by_light = run_cast_and_shade(renderer)
    return evaluated(cast, run_method(renderer, state, cast, by_light))


def evaluated(cast: Cast, rendered: Rendered):
    """Return distance [m], surface and airlight [W/(m^2 sr)], evaluated, of what camera
    rays met and a method did.
    """
    dr.eval(cast.distance, rendered.surface, rendered.airlight, rendered.extra, rendered.carried)
    return cast.distance, rendered.surface, rendered.airlight


def run_cast_and_shade(renderer: FrameRenderer) -> tuple[Cast, tuple[Any, ...]]:
    """Run the stage of camera rays and lit surface; return what the rays meet, and what
    `run_shade` returns for it.
    """
    scene = renderer.scene
    shown = scene.geometry, scene.facets, renderer.pixel, scene.camera, scene.medium
    cast, by_light = renderer.stages.surface(*shown, renderer.shaded[0])
    return cast, _with_others(renderer, cast, by_light)


def run_shade(renderer: FrameRenderer, cast: Cast) -> tuple[Any, ...]:
    """Run the stage of the lit surface on what was cast for an earlier frame, by groups of lights.

    It is None for those that are not kept, and empty for those whose light the first one has.
    """
    return _with_others(renderer, cast, _shaded(renderer, renderer.shaded[0], cast))


def _with_others(
    renderer: FrameRenderer, cast: Cast, by_light: tuple[PerRay, ...]
) -> tuple[Any, ...]:
    """Return surfaces by groups of lights; `by_light` are those of the first."""
    if not renderer.method.provides_visibility:
        return (by_light, *[()] * (len(renderer.groups) - 1))
    kept, others = kept_groups(by_light), renderer.shaded[1:]
    shaded = (
        _shaded(renderer, tables, cast) if k < kept else None for k, tables in enumerate(others, 1)
    )
    return (by_light, *shaded)


def _shaded(renderer: FrameRenderer, tables: tuple[LightTable, ...], cast: Cast):
    """Return the surfaces that camera rays met in the light of some tables."""
    scene, stages = renderer.scene, renderer.stages
    geometry = scene.geometry if stages.shade_casts_rays else None
    return stages.shade(
        geometry, scene.facets, renderer.pixel, scene.camera, scene.medium, tables, cast
    )


def run_method(
    renderer: FrameRenderer, state, cast: Cast, by_light, carried: Any = None
) -> Rendered:
    """Run the method for all groups of lights.

    `renderer`, `state`: the frame, and what its `prepare` returned; `cast`, `by_light`: from
    `run_cast_and_shade`; `carried`: what the method handed on from the last frame; None for the
    first.
    """
    groups, sums, scales = renderer.groups, None, dict[int | None, Any]()
    past = None
    if renderer.history is not None and carried is not None:
        carried, past = carried
    noise = None
    if renderer.method.noisy:
        noise = Noise(
            dr.opaque(mi.UInt32, renderer.run), dr.opaque(mi.UInt32, renderer.frame), renderer.mask
        )
    if renderer.sphere_scales is not None:
        scales = _sphere_scales(renderer, cast)
    for number, group in enumerate(groups):
        shaded = (
            by_light[number]
            if by_light[number] is not None
            else _shaded(renderer, group.tables, cast)
        )
        own = state[number] if state[number] is not None else renderer.stages.prepare(group.scene)
        rendered = _run_group(
            renderer, group, own, cast, shaded, first=number == 0, last=carried, noise=noise
        )
        if (scale := scales.get(group.source)) is not None:
            rendered = replace(rendered, airlight=rendered.airlight * scale)
        if sums is None:
            sums = rendered
        else:
            airlight = sums.airlight + rendered.airlight
            surface = sums.surface if rendered.surface is None else sums.surface + rendered.surface
            sums = replace(sums, airlight=airlight, surface=surface)
        if len(groups) > 1:
            dr.eval(sums.airlight, sums.surface)
    assert sums is not None
    if renderer.history is None:
        return sums
    airlight, past = renderer.history(
        sums.airlight, renderer.pixel, cast.distance, renderer.scene.camera, past
    )
    return replace(sums, airlight=airlight, carried=(sums.carried, past))


def _sphere_scales(renderer: FrameRenderer, cast: Cast) -> dict[int | None, Any]:
    """Return by what the airlight of samples is scaled, by the number of their sphere light."""
    scene, scales = renderer.scene, dict[int | None, Any]()
    assert renderer.sphere_scales is not None
    for number, light in enumerate(scene.area_lights):
        if light.kind == "sphere":
            sphere = sampled_sphere(light, renderer.light_samples, type(scene.camera.origin.x))
            like = next(sample for sample in renderer.lights if sample.source == number)
            shown = (
                scene.camera,
                renderer.pixel,
                scene.medium,
                like,
                sphere,
                cast.distance,
                renderer.kernel,
            )
            scales[number] = renderer.sphere_scales(*shown)
            dr.eval(scales[number])
    return scales


def _run_group(
    renderer: FrameRenderer,
    group: LightGroup,
    state,
    cast: Cast,
    by_light,
    *,
    first: bool,
    last,
    noise,
) -> Rendered:
    """Run the method for one group of lights."""
    scene, method = renderer.scene, renderer.method
    geometry = scene.geometry if method.casts_rays else None
    shown = (
        geometry,
        renderer.pixel,
        scene.camera,
        scene.medium,
        group.tables,
        state,
        cast.distance,
        by_light,
    )
    more = (last, noise) if method.noisy else (last,) if method.carries else ()
    airlight, surface, extra, carried = renderer.stages.render(
        *shown, renderer.kernel, first, *more
    )
    if surface is None and by_light:
        surface = _sum(by_light)
    return Rendered(airlight, surface, extra, carried)


def kept_groups(state: Any) -> int:
    """Return of how many groups of lights states, or surfaces, like this are kept: not
    more than fill the room.
    """
    return max(1, _ROOM // max(_bytes_in(state), 1))


def _bytes_in(value: Any) -> int:
    """Return the size of the Dr.Jit arrays in a state [bytes]."""
    if isinstance(value, tuple | list):
        return sum(_bytes_in(item) for item in value)
    if is_dataclass(value):
        return sum(_bytes_in(item) for item in vars(value).values())
    if not dr.is_array_v(value):
        return 0
    return (
        sum(map(_bytes_in, value))
        if dr.depth_v(value) > 1
        else dr.width(value) * dr.itemsize_v(value)
    )


def image_frame(
    renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None = None
) -> Frame:
    """Bring `stages`, what `run_stages` returned, to the host in the order of the
    image, and `extra` layers.
    """
    frame = unchecked_frame(renderer, stages, extra)
    check_radiance(
        renderer.scene, renderer.method.name, frame.airlight, frame.surface, frame.distance
    )
    return frame


def unchecked_frame(
    renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None = None
) -> Frame:
    """Do what `image_frame` does, and return radiance that is not finite too,
    for anyone who counts it.
    """
    return frame_with_part(None, renderer, stages, extra)


def frame_with_part(
    frame: Frame | None, renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None
) -> Frame:
    """Return a frame with the pixels of a renderer written into it; a new one
    where there is none yet.
    """
    distance, surface, airlight = stages
    shown = {name: _colour(renderer, values) for name, values in (extra or {}).items()}
    return Frame(
        _image(renderer, airlight, frame and frame.airlight),
        _image(renderer, surface, frame and frame.surface),
        _image(renderer, distance, frame and frame.distance),
        {
            name: _image(renderer, values, frame and frame.extra[name])
            for name, values in shown.items()
        },
    )


def _colour(renderer: FrameRenderer, values):
    """Return a layer as a colour: a number is grey."""
    Color = type(renderer.scene.medium.albedo)
    return values if isinstance(values, Color) else Color(values)


def _image(renderer: FrameRenderer, values, image=None):
    """Write values by lane to their pixels of an image (height, width[, 3]), a new one
    by default, and return it.
    """
    camera, pixel = renderer.scene.camera, np.array(renderer.pixel)
    channels = (
        [np.array(channel) for channel in values] if dr.depth_v(values) > 1 else [np.array(values)]
    )
    if image is None:
        image = np.empty((camera.height, camera.width, len(channels)), dtype=channels[0].dtype)
        image = image if dr.depth_v(values) > 1 else image[..., 0]
    by_pixel = image.reshape(-1, len(channels))
    for number, channel in enumerate(channels):
        by_pixel[pixel, number] = channel
    return image
