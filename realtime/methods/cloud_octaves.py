# SPDX-License-Identifier: BSD-3-Clause
r"""Octaves: multiple scattering as single scattering with less and less
extinction, as in game engines.

Light that was scattered more often arrives with less extinction and from more directions. Octave n
is therefore single scattering with the optical depth of the shadow segment times a^n, the radiance
times b^n, and the mean cosine of the phase function times c^n:

    L = sum_{n < N} b^n w E/(4 pi) int kappa P_n(cos) exp(-tau(x) - a^n l(x)) dx.

Wrenninge 2013 halves all three with every octave; Hillaire 2016 leaves a, b and c to the artist and
asks for b <= a, so that no octave creates light. Octave 0 is single scattering with the phase
function of the scene; the others use the Henyey-Greenstein function with c^n times the mean cosine
of the scene's. Errors by order of scattering count octave n as the order n + 1, which it stands
for.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from airlight.errors import InputError
from airlight.realtime.clouds.canonical.coordinates import OPACITY, ORDER_LAYERS, order_layer
from airlight.realtime.clouds.density_maps import LightDepths, sun_depths
from airlight.realtime.clouds.march import (
    CloudSurfaces,
    cloud_surfaces,
    segment_by_lengths,
    segment_through,
)
from airlight.realtime.clouds.single_scattering import (
    Beam,
    cloud_rays,
    light_on_surfaces,
    light_once,
    opacity_of,
    sky_behind,
)
from airlight.realtime.clouds.uniform_sky import SkyEscapes, beams_of, sky_escapes, sky_light
from airlight.realtime.methods.interface.method import Layers, Method, View
from airlight.realtime.parameters import MOST_STEPS, parameter
from airlight.realtime.scene.media.bounded import Clouds
from airlight.realtime.scene.phase import HenyeyGreenstein, Phase, named_phase
from airlight.realtime.scene.read_scene import Scene


def _check_phase(words: Any) -> None:
    # How many numbers may follow a name; -1 below refuses every other name.
    name, *cells = str(words).split(":")
    numbers = {"scene": 0, "isotropic": 0, "hg": 1, "hg-draine": 1}
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        values = [math.nan]
    if (
        len(values) > numbers.get(name, -1)
        or (name == "hg" and not values)
        or not all(map(math.isfinite, values))
    ):
        raise InputError(
            f"phase: got {words!r}, expected scene, isotropic, hg:G or hg-draine:DIAMETER [um]"
        )
    # `named_phase` checks the diameter of a droplet; the bounds of a mean cosine are checked here.
    if name == "hg" and not -1 < values[0] < 1:
        raise InputError(
            f"phase: got {words!r}, expected a mean cosine between -1 and 1, such as hg:0.85"
        )


@dataclass(frozen=True)
class CloudOctaves(Method):
    """The light of clouds by octaves, their opacity, and how much they
    attenuate the light on surfaces.

    References
    ----------
    Wrenninge, Kulla, Lundqvist 2013, *Oz: the great and volumetric*, SIGGRAPH talks. Hillaire 2016,
    *Physically based sky, atmosphere and cloud rendering in Frostbite*, SIGGRAPH course, section
    5.6.
    """

    name = "cloud-octaves"
    summary = "clouds: single scattering with less extinction in every octave, as in game engines"
    source = "Wrenninge 2013; Hillaire 2016"
    renders_clouds = True
    at_once = True
    prepared_from = frozenset({"geometry", "light"})
    casts_rays = True
    provides_visibility = True

    octaves: int = parameter(
        8, "number of octaves; each multiplies the last by a, b and c", least=1, most=31
    )
    extinction: float = parameter(
        0.5, "a: factor on the optical depth to the light", above=0, most=1
    )
    contribution: float = parameter(0.5, "b: factor on the radiance", above=0, most=1)
    anisotropy: float = parameter(0.5, "c: factor on the mean cosine", least=0, most=1)
    phase: str = parameter(
        "scene",
        "scene: that of each cloud; isotropic, hg:G or hg-draine:DIAMETER for all",
        check=_check_phase,
        wanted="scene, isotropic, hg:G or hg-draine:DIAMETER",
    )
    steps: int = parameter(32, "steps of every ray", least=1, most=MOST_STEPS)
    stride: float = parameter(
        1.0,
        "longest step through a grid of densities where a ray enters",
        above=0,
        most=100,
        unit="voxels",
    )
    sky: str = parameter(
        "uniform",
        "the light of a sky, the same from everywhere, or octaves of a beam from above of pi times "
        "its radiance",
        choices=("uniform", "beams"),
    )

    def preparation(self, scene):
        """Return a function that makes the state of a frame."""
        return _preparation(scene, self)

    def render(self, view, state, kernel):
        """Return the layers of every ray."""
        return _octaves(view, state, self)


@dataclass(frozen=True)
class OctaveState:
    """The state of all lights; constants are arrays, so that other values need no new recording."""

    surfaces: CloudSurfaces
    extinction: Any
    contribution: Any
    anisotropy: Any
    means: Any  #: by phase function of the clouds, its mean cosine [1]
    stride: Any  #: longest step through a grid of densities [voxels]
    #: by light and cloud, where clouds have densities
    depths: tuple[tuple[LightDepths, ...], ...] = ()
    escapes: SkyEscapes | None = None  #: where there is a sky that is no beam


def _preparation(scene: Scene, parameters: CloudOctaves) -> Callable[[Scene], OctaveState]:
    """Return the function that makes the state of a frame."""
    clouds = scene.medium.clouds
    assert clouds is not None  # `media_checks` refuses the others
    # Mean cosines take a quadrature on the host, and boundaries a table of their facets: both are
    # made once for all frames.
    Float = type(scene.camera.origin.x)
    means = [mean_cosine(phase, Float) for phase in _phases(clouds, parameters, Float)]
    uniform = len(beams_of(scene.lights, parameters.sky, clouds)) < len(scene.lights)
    state = OctaveState(
        cloud_surfaces(scene),
        extinction=dr.opaque(Float, parameters.extinction),
        contribution=dr.opaque(Float, parameters.contribution),
        anisotropy=dr.opaque(Float, parameters.anisotropy),
        means=Float(means),
        stride=dr.opaque(Float, parameters.stride),
        escapes=sky_escapes(scene) if uniform else None,
    )
    dr.make_opaque(state.means)
    if clouds.density is None:
        return lambda now: state

    # Suns may move: the depths of their light in a grid of densities are those of the frame.
    def with_depths(now: Scene) -> OctaveState:
        return replace(
            state, depths=sun_depths(state.surfaces, clouds, now.lights, stride=state.stride)
        )

    return with_depths


def _octaves(view: View, state: OctaveState, parameters: CloudOctaves) -> Layers:
    """Return the layers of every ray."""
    clouds, surfaces = view.medium.clouds, state.surfaces
    assert clouds is not None
    Color = type(clouds.albedo)
    rays = cloud_rays(
        surfaces, clouds, view.origin, view.direction, view.distance, stride=state.stride
    )
    suns = beams_of(view.lights, parameters.sky, clouds)
    beams = [_beam(view, state, number, parameters) for number in suns]
    # By sun and octave the integral with a^n and P_n; the sum over the suns is the light of the
    # octave.
    by_light = light_once(rays, beams, steps=parameters.steps, stride=state.stride)
    by_octave = [sum(radiances) for radiances in zip(*by_light)]
    # Octave n has the factor b^n.
    amount, amounts = type(view.distance)(1), []
    for radiance in by_octave:
        amounts.append(amount * radiance)
        amount = amount * state.contribution
    # Octave n stands for the order n + 1. A uniform sky has no octaves: its orders come from
    # `realtime.clouds.uniform_sky` and are added to the layers of the same names.
    parts = [(order_layer(octave + 1), radiance) for octave, radiance in enumerate(amounts)]
    for number, light in enumerate(view.lights):
        if state.escapes is not None and number not in suns:
            of_sky = sky_light(
                state.escapes, light, rays, view.visible if view.features.shadows else None
            )
            parts += zip(ORDER_LAYERS, of_sky)
    # Several octaves, and the sky, may count to one layer of orders.
    opacity = opacity_of(rays.depths, Color)
    extra: dict[str, Any] = {}
    if view.extra_layers:
        for name, radiance in parts:
            extra[name] = extra[name] + radiance if name in extra else radiance
        extra[OPACITY] = opacity
    return Layers(
        sum((radiance for _, radiance in parts), Color(0)),
        tuple(
            light_on_surfaces(rays, segment_through(surfaces, clouds, light, stride=state.stride))
            for light in view.lights
        ),
        1 - opacity,
        sky_behind(view.lights, view.distance, Color),
        extra,
    )


def mean_cosine(phase: Phase, Float: Any) -> float:
    """Return the mean cosine of a phase function [1]; `Float` is the type of its arrays."""
    # The midpoint rule with 20 000 steps in u, the root of the angle over pi. A lobe about 0
    # degrees then has many steps: theta = pi u^2, d theta ~ u du.
    angles = 20_000
    root = (np.arange(angles) + 0.5) / angles
    angle = np.pi * root**2
    fraction = (
        np.sin(angle) * np.array(phase.evaluate(Float(np.cos(angle))), dtype=np.float64) * root
    )
    return float(fraction @ np.cos(angle) / fraction.sum())


def _phases(clouds: Clouds, parameters: CloudOctaves, Float: Any) -> tuple[Phase, ...]:
    """Return the phase functions of octave 0."""
    if parameters.phase == "scene":
        return clouds.phases
    return (named_phase(parameters.phase, Float=Float),) * len(clouds.phases)


def _beam(view: View, state: OctaveState, number: int, parameters: CloudOctaves) -> Beam:
    """Return a light with the depths of its segments and its phase functions by octave."""
    clouds, surfaces, light = view.medium.clouds, state.surfaces, view.lights[number]
    assert clouds is not None
    Float = type(view.distance)
    # Octave n: the depth to the light times a^n; the phase function of the scene for n = 0,
    # otherwise Henyey-Greenstein with c^n times the mean cosine. `sharp` is c^n of the next octave.
    cosine = -dr.dot(view.direction, light.axis)  # forward where the eye looks into the sun
    scale, sharp = Float(1), state.anisotropy
    scales, phases = [], []
    for octave in range(parameters.octaves):
        scales.append(scale)
        scale = scale * state.extinction
        if octave == 0:
            octave_phases = _phases(clouds, parameters, Float)
        else:
            means = (dr.gather(Float, state.means, number) for number in range(len(clouds.phases)))
            octave_phases = tuple(HenyeyGreenstein(sharp * mean) for mean in means)
            sharp = sharp * state.anisotropy
        phases.append(tuple(phase.evaluate(cosine) for phase in octave_phases))
    segment = segment_through(surfaces, clouds, light, stride=state.stride)
    if state.depths:
        segment = segment_by_lengths(clouds, [of_cloud.at for of_cloud in state.depths[number]])
    # Opaque shapes hide the light at each step, where there are any.
    lit = (lambda point, active: view.visible(point, light)) if view.features.shadows else None
    return Beam(light.intensity, tuple(scales), tuple(phases), segment, lit)
