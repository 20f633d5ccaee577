# SPDX-License-Identifier: BSD-3-Clause
"""Reading a Mitsuba scene: the camera, the medium, the lights, and the features
that need their own code.

Any Mitsuba scene can be read; it needs no additions. Features that no method supports are refused
by name. A frame runs only the code that the features of a scene need (DESIGN section 5).
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.area_lights.shape import AreaLight, read_area_light
from airlight.realtime.numerics.array_types import ArrayTypes, array_types, types_of
from airlight.realtime.scene.camera import Camera, sensor_camera
from airlight.realtime.scene.directional_extent import (
    directional_fields,
    distance_before,
    media_spheres,
    shape_spheres,
)
from airlight.realtime.scene.light_table import LightTable, light_tables
from airlight.realtime.scene.lights import Light, spot_fields
from airlight.realtime.scene.media.medium import Medium
from airlight.realtime.scene.read_media import opaque_scene, read_medium, sort_shapes
from airlight.realtime.scene.rounding import rounding_notes
from airlight.realtime.scene.triangle_table import Facets, read_facets
from airlight.realtime.transforms import beam_axis, host_matrix, spot_axis


@dataclass(frozen=True)
class SceneFeatures:
    """The code that the shapes of a scene need; media, lights and methods answer for themselves."""

    shadows: bool  #: there is something that can cast a shadow
    surfaces: bool  #: there is something that the camera can see
    notes: tuple[str, ...] = ()  #: what the user should know of this scene


@dataclass(frozen=True)
class Scene:
    """A Mitsuba scene with what a real-time method reads from it."""

    #: of all opaque shapes, for casting rays: an `mi.Scene`, whose shapes move in place
    #: (`realtime.scene.animate`)
    geometry: Any
    camera: Camera
    medium: Medium
    lights: tuple[Light, ...]  #: point, spot and directional lights, and skies over clouds
    features: SceneFeatures
    facets: Facets | None = None  #: the triangles, where a table says all that shading needs
    #: vertices of shapes that moved, by name [m]
    positions: Mapping[str, Any] = field(default_factory=dict)
    area_lights: tuple[AreaLight, ...] = ()  #: methods render samples of them
    #: of the area lights whose samples are all among `lights`
    sample_tables: tuple[LightTable, ...] = ()
    #: radiance of a uniform sky behind fog, RGB [W/(m^2 sr)]: closed forms
    #: of shading show its light
    sky: Any = None
    #: Mitsuba's shapes around bounded media, in the order of `Medium.clouds`
    boundaries: tuple[Any, ...] = ()

    @cached_property
    def tables(self) -> tuple[LightTable, ...]:
        """The lights, a table for each structure and area light."""
        return light_tables(self.lights, self.sample_tables)

    def source_shape(self, light: Light) -> str | None:
        """Return the name of the shape of a light sample that casts no
        shadow in it; None otherwise.
        """
        area = None if light.source is None else self.area_lights[light.source]
        return None if area is None or area.folded else area.name


def read_scene(scene, precision: str = "single") -> Scene:
    """Read a Mitsuba scene.

    Parameters
    ----------
    scene
        An `mi.Scene` of the current RGB variant.
    precision
        'single' or 'double': the precision of every array that the methods compute with.

    Raises
    ------
    InputError
        For a scene that no method can render, with the name of what it cannot do.
    """
    # Rays meet opaque shapes alone: boundaries of media and shapes of light are read and left out.
    types = array_types(precision)
    parts, opaque = _read_parts(scene, types)
    geometry = opaque_scene(scene, opaque)
    return Scene(geometry, facets=read_facets(geometry, types), **parts)


def read_again(known: Scene, scene) -> Scene:
    """Return a scene that was read before with the present camera, medium and
    lights; the shapes stay.

    Parameters
    ----------
    known
        As `read_scene` returned it.
    scene
        The `mi.Scene` from which it was read.

    Raises
    ------
    InputError
        As `read_scene`.
    """
    parts, _ = _read_parts(scene, types_of(type(known.camera.origin.x)))
    return replace(known, **parts)


def _read_parts(scene, types: ArrayTypes) -> tuple[dict[str, Any], list[Any]]:
    """Return the fields of a `Scene` except for its shapes, and the opaque shapes."""
    # The medium first: it says which lights it lets in.
    camera, sensor = sensor_camera(scene, types)
    opaque, boundaries = sort_shapes(scene)
    medium = read_medium(sensor, boundaries, types)
    if not scene.emitters():
        raise InputError(
            "the scene has no light; expected at least one emitter of type 'point', 'spot', "
            "'directional' or 'area'"
        )
    # Lights from infinity need to know what they light. A constant emitter lights clouds, as a
    # beam, or it is one of the backgrounds.
    bodies = _Bodies(medium, boundaries, opaque)
    behind = backgrounds(scene, clouds=medium.clouds is not None)
    lights = tuple(
        _read_directional(emitter, bodies, types)
        if emitter.class_name() == "DirectionalEmitter"
        else _read_sky(emitter, bodies, _upwards(scene, camera), types)
        if emitter.class_name() == "ConstantBackgroundEmitter" and medium.clouds is not None
        else _read_light(emitter, types)
        for emitter in scene.emitters()
        if emitter.class_name() != "AreaLight" and emitter not in behind
    )
    # Area lights are emitters of shapes, and are read as shapes.
    origin = np.array(camera.origin, dtype=np.float64).ravel()
    area_lights = tuple(
        read_area_light(shape, origin) for shape in scene.shapes() if shape.is_emitter()
    )
    parts = {
        "camera": camera,
        "medium": medium,
        "lights": lights,
        "features": _scene_features(scene, bodies, lights, area_lights),
        "area_lights": area_lights,
        "sky": _sky_behind(behind, types),
        "boundaries": tuple(boundaries),
    }
    return parts, opaque


@dataclass(frozen=True)
class _Bodies:
    """The media and shapes that light meets."""

    medium: Medium
    boundaries: list[Any]  #: Mitsuba's shapes around bounded media
    opaque: list[Any]  #: Mitsuba's other shapes

    def beam(self, axis, types: ArrayTypes) -> dict[str, Any]:
        """Return the fields of a `Light` from infinity, which travels along a unit vector."""
        # Without bounded media the beam lights all that is between the opaque shapes.
        spheres = media_spheres(self.boundaries) if self.boundaries else shape_spheres(self.opaque)
        return directional_fields(
            axis,
            spheres,
            distance_before(spheres, self.opaque),
            types,
            without_sides=not self.boundaries,
        )


def _read_light(emitter, types: ArrayTypes) -> Light:
    kind = {"PointLight": "point", "SpotLight": "spot"}.get(emitter.class_name())
    if kind is None:
        word = {"ConstantBackgroundEmitter": "constant", "EnvironmentMapEmitter": "envmap"}
        raise InputError(
            f"light '{emitter.id()}' of type "
            f"'{word.get(emitter.class_name(), emitter.class_name())}' lights no fog; "
            "expected lights of type 'point', 'spot', 'directional' or 'area'"
        )
    # One colour for all directions, and one value for a spot's texture.
    parameters = mi.traverse(emitter)
    if "intensity.value" not in parameters or (
        kind == "spot" and "texture.value" not in parameters
    ):
        raise InputError(
            f"light '{emitter.id()}' of type '{kind}' has a texture or a spectrum as intensity; "
            "give one 'rgb' value"
        )
    intensity = _read_colour(parameters["intensity.value"], f"the {kind} light's intensity", "W/sr")
    # A point light says its place, which its transform may not.
    place = (
        parameters["position"] if kind == "point" else host_matrix(emitter.world_transform())[:3, 3]
    )
    position = np.array(place, dtype=np.float64).reshape(-1)
    # Opaque arrays: a light that moves or fades recompiles nothing.
    arrays: dict[str, Any] = {
        "position": types.vector(*(float(c) for c in position)),
        "intensity": types.color(*(float(c) for c in intensity)),
    }
    if kind == "spot":
        cutoff, beam = _read_angles(parameters)
        arrays |= spot_fields(spot_axis(emitter), cutoff, beam, types)
    dr.make_opaque(*arrays.values())
    return Light(**arrays)


def _read_directional(emitter, bodies: _Bodies, types: ArrayTypes) -> Light:
    axis = beam_axis(emitter)
    bodies.medium.check_beam(axis, emitter.id())
    # The irradiance of a plane across the light stands for its intensity.
    parameters = mi.traverse(emitter)
    if "irradiance.value" not in parameters:
        raise InputError(
            "the directional light has a textured or spectral irradiance; expected a constant "
            "'rgb' one"
        )
    irradiance = _read_colour(
        parameters["irradiance.value"], "the directional light's irradiance", "W/m^2"
    )
    arrays: dict[str, Any] = {"intensity": types.color(*(float(c) for c in irradiance))}
    arrays |= bodies.beam(axis, types)
    dr.make_opaque(*arrays.values())
    return Light(**arrays)


def _read_sky(emitter, bodies: _Bodies, up: NDArray[np.float64], types: ArrayTypes) -> Light:
    """Return the beam that stands for a uniform sky of radiance L: from
    above, of the irradiance pi L.

    That is what the upper half of the sky sends through a horizontal plane.
    """
    parameters = mi.traverse(emitter)
    if "radiance.value" not in parameters:
        raise InputError(
            "the constant emitter has a textured or spectral radiance; expected a constant 'rgb' "
            "one"
        )
    radiance = _read_colour(
        parameters["radiance.value"], "the constant emitter's radiance", "W/(m^2 sr)"
    )
    # The integral of L cos over a half space is pi L.
    arrays: dict[str, Any] = {
        "intensity": types.color(*(math.pi * float(c) for c in radiance)),
        "sky": types.color(*(float(c) for c in radiance)),
    }
    arrays |= bodies.beam(-up, types)
    dr.make_opaque(*arrays.values())
    return Light(**arrays)


def _sky_behind(behind: list[Any], types: ArrayTypes):
    """Return the radiance of a uniform sky that lights no clouds, 0 without one."""
    skies = [
        mi.traverse(emitter)
        for emitter in behind
        if emitter.class_name() == "ConstantBackgroundEmitter"
    ]
    # A sky with a texture or a spectrum counts as none.
    given = skies[0]["radiance.value"] if skies and "radiance.value" in skies[0] else 0.0
    radiance = types.color(
        *(float(c) for c in _read_colour(given, "the constant emitter's radiance", "W/(m^2 sr)"))
    )
    dr.make_opaque(radiance)
    return radiance


def _upwards(scene, camera: Camera) -> NDArray[np.float64]:
    """Return the axis of coordinates that is upright in the image, a unit vector (3,).

    A camera that is not rolled has it across its left; of several such axes it is the one from
    which the suns shine most, and without suns the nearest to the camera's up.
    """
    # Axes of coordinates across the camera's left, and at least a thousandth upwards in the image.
    upward = 1e-3  # cosine between the camera's left, or its up, and such an axis
    left, up = (np.array(vector, dtype=np.float64).ravel() for vector in (camera.left, camera.up))
    left, up = left / np.linalg.norm(left), up / np.linalg.norm(up)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    upright = axes[(np.abs(axes @ left) < upward) & (axes @ up > upward)]
    # Suns shine downwards: the sum of their directions decides between several axes.
    falling = np.zeros(3)
    for emitter in scene.emitters():
        if emitter.class_name() == "DirectionalEmitter":
            falling += beam_axis(emitter)
    # A rolled camera has none: then the nearest to its up.
    if not len(upright):
        return axes[np.argmax(axes @ up)]
    return upright[np.argmax(upright @ (-falling if falling.any() else up))]


def _read_colour(value, name: str, unit: str):
    """Return three values of 0 or more."""
    colour = np.array(value, dtype=np.float64).reshape(-1)
    # One number is grey.
    colour = np.broadcast_to(colour, 3) if colour.size == 1 else colour
    if not np.all(np.isfinite(colour)) or np.any(colour < 0):
        raise InputError(
            f"{name} is {colour.tolist()}; expected finite values of 0 or more [{unit}]"
        )
    return colour


def _read_angles(parameters) -> tuple[float, float]:
    """Return the half angles of a spot's cut-off and of its beam [rad]."""
    cutoff = math.radians(float(parameters["cutoff_angle"][0]))
    # Mitsuba's beam ends at the cut-off.
    beam = min(math.radians(float(parameters["beam_width"][0])), cutoff)
    if not 0 < cutoff < 0.5 * math.pi:
        raise InputError(
            f"the spot light's cutoff_angle is {math.degrees(cutoff):g} degrees; expected more "
            "than 0, less than 90"
        )
    return cutoff, beam


def _scene_features(
    scene, bodies: _Bodies, lights: tuple[Light, ...], area_lights: tuple[AreaLight, ...]
) -> SceneFeatures:
    # 0x3FF are Mitsuba's flags of the kinds of scattering: a shape that has any but diffuse
    # reflection gets a note.
    opaque = bodies.opaque
    notes = scene_notes(scene, clouds=bodies.medium.clouds is not None)
    for shape in opaque:
        flags = shape.bsdf().flags()
        if (
            flags
            & ~int(mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide)
            & 0x3FF
        ):
            notes.append(
                f"shape '{shape.id()}' is not purely diffuse: shaded by its diffuse reflectance, "
                "airlight unaffected"
            )
    # A light by itself casts no shadow, unless parts of it stand in the light of others.
    alone = (
        not lights and len(area_lights) == 1 and area_lights[0].opaque and not area_lights[0].folded
    )
    return SceneFeatures(
        shadows=len(opaque) > (1 if alone else 0),
        surfaces=bool(opaque),
        notes=tuple(dict.fromkeys(notes)),
    )


def _axis_name(light: Light) -> str:
    """Return the axis of coordinates from which a beam comes: 'x', '-x', 'y', '-y', 'z' or '-z'."""
    source = -np.array(light.exact_axis).ravel()
    number = int(np.argmax(np.abs(source)))
    return ("-" if source[number] < 0 else "") + "xyz"[number]


def backgrounds(scene, *, clouds: bool = True) -> list[Any]:
    """Return the backgrounds that a scene with lights shows: an environment, or a sky
    that is no light of clouds.

    A constant emitter beside directional lights alone lights clouds
    (`_read_sky`), if there may be any.
    """
    around = {"EnvironmentMapEmitter", "ConstantBackgroundEmitter"}
    lights = {emitter.class_name() for emitter in scene.emitters()} - around
    # With directional lights alone, or by itself, a constant emitter is a light of clouds.
    around -= (
        {"ConstantBackgroundEmitter"} if clouds and lights <= {"DirectionalEmitter"} else set()
    )
    return [emitter for emitter in scene.emitters() if lights and emitter.class_name() in around]


def scene_notes(scene, *, clouds: bool = True) -> list[str]:
    """Return notes on the cameras and the lights of a Mitsuba scene, a line each."""
    cameras = len(scene.sensors())
    notes = rounding_notes(scene)
    # A frame has one camera. It shows backgrounds, and leaves out their light that fog scatters.
    notes += (
        [f"the scene has {cameras} cameras: the first is used, the others are left out"]
        if cameras > 1
        else []
    )
    notes += [
        f"light '{emitter.id()}' around the scene is seen behind it; light of it that is scattered "
        "is left out"
        + " by methods: references and fog colours have it"
        * (emitter.class_name() == "ConstantBackgroundEmitter")
        for emitter in backgrounds(scene, clouds=clouds)
    ]
    return notes


def describe(scene: Scene) -> dict[str, str]:
    """Return in words what a scene needs, one entry for each decision about
    the code that a frame runs.
    """
    # Lights by kind; a sky is a beam in the list of lights, and has words for itself.
    counts = Counter(light.kind for light in scene.lights if light.sky is None)
    lights = [f"{counts[kind]} {kind}" for kind in ("point", "spot", "directional") if counts[kind]]
    extents = Counter(light.kind for light in scene.area_lights)
    lights += [f"{count} {shape} with extent" for shape, count in extents.items()]
    lights += [
        f"a sky, as a beam from {_axis_name(light)}"
        for light in scene.lights
        if light.sky is not None
    ]
    # A phase function that is 1 everywhere, and a spot without transition, leave code out.
    isotropic = all(phase.constant for phase in scene.medium.phases)
    soft = any(light.beam is not None for light in scene.lights)
    return {
        "surfaces": "lit surfaces"
        if scene.features.surfaces
        else "none: no ray is cast for the camera",
        "shadows": "visibility tests" if scene.features.shadows else "none: nothing casts a shadow",
        "extinction": "one for all channels"
        if scene.medium.channels == 1
        else "one for each channel: three integrals a ray",
        "phase function": "isotropic: left out of the integrand"
        if isotropic
        else "anisotropic: split at the foot point",
        "medium": scene.medium.summary,
        "lights": " and ".join(lights),
        "spot falloff": "inside the cone: integrand weighted"
        if soft
        else "none: rays are clipped to cones at most",
    }
