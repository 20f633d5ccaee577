# SPDX-License-Identifier: BSD-3-Clause
"""A frame on the device: camera rays, the lit surface, and the airlight of a method.

A frame has four stages:

- `prepare`: what the method makes of the scene, such as shadow maps, for each group of lights;
- `surface`: camera rays are cast, and shadow rays say how bright the surfaces are that they meet;
- `shade`: the surfaces again, where the rays of the last frame still hold;
- `render`: the airlight of the method, for each group of lights, and the surfaces of a method that
  says itself which of its lights reaches them.

The last three are recorded functions (`drjit.freeze`), which record their kernels on the first call
and replay them afterwards, so that a frame costs its kernels and little else. A method whose arrays
change their sizes from frame to frame is not frozen. All that moves (camera, lights, medium, shadow
maps) is passed in as opaque arrays. `realtime.frame.light_groups` says which lights are a group,
`realtime.frame.incremental` which stages the next frame needs, and `realtime.frame.image` brings a
frame to the host.

A large image of a method that computes each ray by itself is rendered in parts, one after the
other: the intermediate arrays are then as large as a part. Where the method needs the whole image,
its stage is not frozen if the image is large: a replay of Dr.Jit 1.5 frees intermediate arrays only
at its end, and filters make some twenty intermediate images.
"""

import gc
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import add
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.errors import InputError
from airlight.realtime.area_lights.points import LightSamples
from airlight.realtime.frame.history import HistoryPass
from airlight.realtime.frame.light_groups import LightGroup, group_states, light_groups
from airlight.realtime.frame.sphere_lights import sampled_sphere, sphere_scales
from airlight.realtime.frame.surface import Cast, lit_surfaces, surface_stages
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
from airlight.realtime.scene.light_table import LightTable, by_tables, sampled_lights, structure
from airlight.realtime.scene.read_scene import Scene

_LARGE = 2**21  # pixels; a larger image is rendered in parts where it can be
_PART = 2**20  # pixels of a part at most


@dataclass(frozen=True)
class Stages:
    """The recorded functions of a frame; each is recorded once for each structure of lights."""

    prepare: Preparation  #: scene -> the state of the method: shadow maps, shadow planes
    surface: Callable[..., Any]  #: -> what camera rays meet, and what `shade` returns for it
    shade: Callable[..., Any]  #: -> radiance of the surfaces; None where `render` lights them
    render: Callable[..., Any]  #: -> what `_composed` returns


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
    def lit(self) -> Scene:
        """The scene as it is now, with the samples of its area lights and all lights in the order
        of tables, made once for a frame.
        """
        return _with_samples(self.scene, self.light_samples)

    @cached_property
    def groups(self) -> tuple[LightGroup, ...]:
        """The groups of lights of the scene as it is now."""
        return light_groups(self.lit, self.method, together=self.extra_layers)

    @cached_property
    def tables(self) -> tuple[LightTable, ...]:
        """All lights, for the surfaces that shadow rays light."""
        return () if self.method.provides_visibility else self.lit.tables

    def prepare(self, scene: Scene) -> tuple[Any, ...]:
        """Return the state of the method by groups of lights, None for those that are not kept."""
        renderer = self if scene is self.scene else replace(self, scene=scene)
        return group_states(renderer.groups, self.stages.prepare)


@dataclass(frozen=True)
class Rendered:
    """The result of a method, in the order of the lanes, not evaluated."""

    airlight: PerRay  #: in-scattered radiance [W/(m^2 sr)]
    #: radiance of the surface through it [W/(m^2 sr)]; None where there is none, or where it
    #: is what shadow rays found
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

    Parameters
    ----------
    scene
        A scene that `read_scene` has read.
    method
        A method, as `find_method` returns it.
    kernel
        One of `KERNELS`; needed where `method.uses_kernel` says so.
    extra_layers
        Whether frames have the further layers that the method names, which puts all lights into one
        group; never in a scene with area lights.
    parameters
        Parameters of the method, and of light samples; the others have their defaults.

    Raises
    ------
    InputError
        For a parameter that the method does not have, a missing kernel, and a scene that the method
        refuses. Refusals that depend on the rays come with the first frame.
    """
    # The method refuses what it does not render, before anything is computed.
    chosen, samples = method_parameters(method, parameters)
    if chosen.uses_kernel and kernel is None:
        raise InputError(
            f"method {method.name}: got no kernel, expected one of "
            "realtime.kernels.registry.KERNELS"
        )
    check_media(scene, chosen)
    extra_layers &= not scene.area_lights
    groups = light_groups(_with_samples(scene, samples), chosen, together=extra_layers)
    # Groups of one structure need the same memory and are refused alike.
    for group in {
        tuple(structure(light)[1] for light in each.scene.lights): each for each in groups
    }.values():
        chosen.check(group.scene)
    # Neighbouring lanes are neighbouring pixels.
    pixel = aligned_array(mi.UInt32, tiled_pixels(scene.camera.width, scene.camera.height))
    dr.eval(pixel)
    Float = type(scene.camera.origin.x)
    return FrameRenderer(
        scene,
        chosen,
        samples,
        pixel,
        stages=_stages(scene, chosen, extra_layers=extra_layers),
        kernel=kernel.prepared(Float) if chosen.uses_kernel and kernel else None,
        extra_layers=extra_layers,
        sphere_scales=sphere_scales(scene, chosen),
        history=HistoryPass(**values(chosen.history), Float=Float) if chosen.history else None,
        mask=blue_mask() if chosen.noisy else None,
    )


def _with_samples(scene: Scene, samples: LightSamples) -> Scene:
    """Return a scene that has, behind its lights, the samples of its area lights: all
    in the order of `View.lights`, as the states that a method prepares of them.
    """
    lights, tables = sampled_lights(scene.area_lights, samples, type(scene.camera.origin.x))
    # Samples come area light by area light, so that they are in that order.
    return replace(scene, lights=by_tables(scene.lights) + lights, sample_tables=tables)


def _by_rays(method: Method) -> bool:
    return method.by_rays and not method.carries and method.history is None


def _stages(scene: Scene, method: Method, *, extra_layers: bool) -> Stages:
    """Return the recorded functions of a frame."""
    features, through_media = scene.features, not method.renders_clouds
    surface, shade = surface_stages(
        scene, shadow_rays=not method.provides_visibility, through_media=through_media
    )

    def run(
        geometry,
        facets,
        pixel,
        camera,
        medium,
        tables,
        cast,
        state,
        lit,
        kernel,
        first,
        last=None,
        noise=None,
    ):
        view = camera_view(
            camera,
            pixel,
            cast.distance,
            features=features,
            scene=geometry if method.casts_rays else None,
            medium=medium,
            tables=tables,
        )
        view = replace(view, carried=last, noise=noise, extra_layers=extra_layers)
        # A method that knows what its lights reach has the surfaces before any shadow.
        surfaces = None
        if method.provides_visibility and features.surfaces:
            surfaces = lit_surfaces(
                geometry, facets, pixel, camera, medium, cast, through_media=through_media
            )
            view = replace(view, reflected=surfaces.before_shadows)
        with refusals():
            layers = method.render(view, state, kernel)
        if surfaces is not None:
            lit = surfaces.reached(tables, layers.visibility or ())
        return _composed(layers, lit, first=first, changed=surfaces is not None)

    large = scene.camera.width * scene.camera.height > _LARGE
    frozen = method.frozen and (_by_rays(method) or not large)
    ordered = replace(scene, lights=by_tables(scene.lights))  # as in the scenes of frames
    return Stages(method.preparation(ordered), surface, shade, Frozen(run) if frozen else run)


def _composed(layers: Layers, lit: PerRay | None, *, first: bool, changed: bool):
    """Return a frame from layers, by the formula of `realtime.methods.interface.method`.

    `layers`: of a method; `lit`: the radiance of the lit surfaces, None where another group has it,
    or there are none; `first`: whether this is the first group of lights, which shows what is of no
    light; `changed`: whether `lit` is more than what the caller passed in. Returns `airlight`,
    `surface`: in-scattered radiance, and that from behind it [W/(m^2 sr)]; None where that is
    nothing but what the caller passed in; `extra`, `carried`: as the layers have them.
    """
    surface = lit
    if first and layers.background is not None:
        surface = layers.background if surface is None else surface + layers.background
        changed = True
    if surface is not None and layers.transmittance is not None:
        surface = layers.transmittance * surface
        changed = True
    return layers.in_scattered, surface if changed else None, layers.extra, layers.carried


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
    cast, lit = run_cast_and_shade(renderer)
    return evaluated(cast, run_method(renderer, state, cast, lit))


def evaluated(cast: Cast, rendered: Rendered):
    """Return distance [m], surface and airlight [W/(m^2 sr)], evaluated, of what camera
    rays met and a method did.
    """
    surface = rendered.surface
    if surface is None:
        surface = dr.zeros(type(rendered.airlight), dr.width(cast.distance))
    dr.eval(cast.distance, surface, rendered.airlight, rendered.extra, rendered.carried)
    return cast.distance, surface, rendered.airlight


def run_cast_and_shade(renderer: FrameRenderer) -> tuple[Cast, PerRay | None]:
    """Run the stage of camera rays and lit surface; return what the rays meet, and what
    `run_shade` returns for it.
    """
    return renderer.stages.surface(*_shown(renderer), renderer.tables)


def run_shade(renderer: FrameRenderer, cast: Cast) -> PerRay | None:
    """Run the stage of the lit surface on what was cast for an earlier frame.

    It is None where nothing is lit, or where the method lights the surfaces.
    """
    if renderer.method.provides_visibility or not renderer.scene.features.surfaces:
        return None
    return renderer.stages.shade(*_shown(renderer), renderer.tables, cast)


def _shown(renderer: FrameRenderer) -> tuple[Any, ...]:
    scene = renderer.scene
    return scene.geometry, scene.facets, renderer.pixel, scene.camera, scene.medium


def run_method(
    renderer: FrameRenderer, state, cast: Cast, lit: PerRay | None, carried: Any = None
) -> Rendered:
    """Run the method for all groups of lights.

    `renderer`, `state`: the frame, and what its `prepare` returned; `cast`, `lit`: from
    `run_cast_and_shade`; `carried`: what the method handed on from the last frame; None for the
    first.
    """
    method, past = renderer.method, None
    more: tuple[Any, ...] = ()
    if renderer.history is not None and carried is not None:
        carried, past = carried
    # Arguments that few methods have: each costs time in every frame.
    if method.noisy:
        run, frame = (dr.opaque(mi.UInt32, each) for each in (renderer.run, renderer.frame))
        more = (carried, Noise(run, frame, renderer.mask))
    elif method.carries:
        more = (carried,)
    # Light adds up, group by group; the first one has the surfaces that shadow rays lit.
    scales = _sphere_scales(renderer, cast)
    whole: Rendered | None = None
    for number, group in enumerate(renderer.groups):
        own = renderer.stages.prepare(group.scene) if state[number] is None else state[number]
        first = number == 0
        rendered = _run_group(renderer, group, own, cast, lit if first else None, first, more)
        if group.source in scales:
            rendered = replace(rendered, airlight=rendered.airlight * scales[group.source])
        whole = rendered if whole is None else _added(whole, rendered)
        if len(renderer.groups) > 1:
            dr.eval(whole.airlight, whole.surface)
    assert whole is not None
    if renderer.history is None:
        return whole
    airlight, past = renderer.history(
        whole.airlight, renderer.pixel, cast.distance, renderer.scene.camera, past
    )
    return replace(whole, airlight=airlight, carried=(whole.carried, past))


def _run_group(
    renderer: FrameRenderer,
    group: LightGroup,
    state: Any,
    cast: Cast,
    lit: PerRay | None,
    first: bool,
    more: tuple[Any, ...],
) -> Rendered:
    """Run the method for one group of lights."""
    scene, method = renderer.scene, renderer.method
    # A large scene takes milliseconds to pass in, so that only those who cast rays get it.
    lights_surfaces = method.provides_visibility and scene.features.surfaces
    asks = lights_surfaces and (scene.facets is None or group.from_infinity)
    airlight, surface, extra, carried = renderer.stages.render(
        scene.geometry if method.casts_rays or asks else None,
        scene.facets if lights_surfaces else None,
        renderer.pixel,
        scene.camera,
        scene.medium,
        group.tables,
        cast if lights_surfaces else Cast(cast.distance),
        state,
        lit,
        renderer.kernel,
        first,
        *more,
    )
    return Rendered(airlight, lit if surface is None else surface, extra, carried)


def _added(whole: Rendered, rendered: Rendered) -> Rendered:
    """Return the light of some groups and another one; layers and arrays of the first stay."""
    surfaces = [each.surface for each in (whole, rendered) if each.surface is not None]
    surface = reduce(add, surfaces) if surfaces else None
    return replace(whole, airlight=whole.airlight + rendered.airlight, surface=surface)


def _sphere_scales(renderer: FrameRenderer, cast: Cast) -> dict[int | None, Any]:
    """Return by what the airlight of samples is scaled, by the number of their sphere light."""
    scene, scales = renderer.scene, dict[int | None, Any]()
    if renderer.sphere_scales is None:
        return scales
    for number, light in enumerate(scene.area_lights):
        if light.kind == "sphere":
            scales[number] = renderer.sphere_scales(
                scene.camera,
                renderer.pixel,
                scene.medium,
                next(sample for sample in renderer.lit.lights if sample.source == number),
                sampled_sphere(light, renderer.light_samples, type(scene.camera.origin.x)),
                cast.distance,
                renderer.kernel,
            )
            dr.eval(scales[number])
    return scales
