# SPDX-License-Identifier: BSD-3-Clause
"""Reading a scene of clouds for the reference: media of any order of scattering in closed meshes of any shape.

Clouds lie in vacuum, apart from one another. Suns are directional emitters, the sky is at most one emitter of
constant radiance. Other lights are refused by name.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.scene.camera import camera_matrix, film_directions, pixel_centres
from reference.scene.cloud_density import CloudDensity, read_cloud_density
from reference.scene.directional_light import DirectionalLight, is_directional, read_directional
from reference.scene.read import (
    VACUUM,
    ReferenceMedium,
    read_medium,
    read_scattering,
    scene_from,
    scene_of,
    sorted_shapes,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cloud(ReferenceMedium):
    """A medium within a closed surface."""

    shape: Any  #: Mitsuba's shape that bounds it
    density: CloudDensity | None = None  #: over `sigma_t`, the largest extinction; None for a homogeneous medium

    @property
    def name(self) -> str:
        """The id of the shape."""
        return str(self.shape.id())


@dataclass(frozen=True)
class CloudScene:
    """A scene of clouds as the reference sees it."""

    scene: Any  #: the `mi.Scene`, whole
    occluders: Any  #: an `mi.Scene` of the opaque shapes alone
    width: int  #: [pixels]
    height: int  #: [pixels]
    origin: Array  #: the pinhole [m], (3,)
    direction: Array  #: unit directions through the pixel centres, (pixels, 3), row by row
    clouds: tuple[Cloud, ...]
    suns: tuple[DirectionalLight, ...]
    sky: Array  #: radiance of the sky, RGB, zero without one [W/(m^2 sr)]
    camera_cloud: int  #: number of the cloud that the camera is in, -1 in vacuum

    @property
    def around(self) -> ReferenceMedium:
        """The medium around the clouds: vacuum."""
        return VACUUM


def read_clouds(scene) -> CloudScene:
    """Read a scene of clouds of the current RGB variant.

    Raises InputError for a scene without clouds, sun or sky, or with what has no place among them, by its name.
    """
    if not scene.sensors():
        raise InputError("the scene has no camera; wanted a sensor of type 'perspective'")
    sensor = scene.sensors()[0]
    if sensor.class_name() != "PerspectiveCamera":
        raise InputError(f"the camera is a {sensor.class_name()}; wanted a sensor of type 'perspective'")
    suns, sky = _lights(scene)
    opaque, boundaries = sorted_shapes(scene)
    if not boundaries:
        raise InputError("the scene has no cloud; wanted a closed shape of material 'null' with an interior medium")
    for shape in opaque:
        if mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Delta):
            raise InputError(
                f"shape '{shape.id()}' has a {shape.bsdf().class_name()} material, a mirror: paths cannot find the sun "
                "in it; wanted a rough one"
            )
    for shape in boundaries:
        if shape.exterior_medium() is not None:
            raise InputError(f"the exterior medium of shape '{shape.id()}' is not vacuum; wanted none around clouds")
    clouds = tuple(_read_cloud(shape) for shape in boundaries)
    width, height = (int(n) for n in sensor.film().size())
    origin = camera_matrix(sensor)[:3, 3]
    return CloudScene(
        scene=scene,
        occluders=scene_of(opaque, scene),
        width=width,
        height=height,
        origin=origin,
        direction=film_directions(sensor, pixel_centres((width, height)), (width, height)),
        clouds=clouds,
        suns=suns,
        sky=sky,
        camera_cloud=_camera_cloud(sensor, boundaries, origin),
    )


def _lights(scene) -> tuple[tuple[DirectionalLight, ...], Array]:
    suns, skies = [], []
    for emitter in scene.emitters():
        if is_directional(emitter):
            suns.append(read_directional(emitter))
        elif emitter.class_name() == "ConstantBackgroundEmitter":
            skies.append(_radiance(emitter))
        else:
            raise InputError(
                f"light '{emitter.id()}' is a {emitter.class_name()}; clouds are lit by emitters of type 'directional' "
                "and 'constant'"
            )
    if len(skies) > 1:
        raise InputError(f"the scene has {len(skies)} emitters of type 'constant'; wanted at most one sky")
    if not suns and not skies:
        raise InputError("the scene has no light; wanted an emitter of type 'directional' or 'constant'")
    return tuple(suns), skies[0] if skies else np.zeros(3)


def _radiance(emitter) -> Array:
    given = np.array(mi.traverse(emitter)["radiance.value"], dtype=np.float64).reshape(-1)
    return np.broadcast_to(given, 3)


def _read_cloud(shape) -> Cloud:
    medium, name = shape.interior_medium(), f"the medium of shape '{shape.id()}'"
    if not medium.is_homogeneous():
        density = read_cloud_density(shape, name)
        sigma_t = np.full(3, density.largest)
        return Cloud(sigma_t, *read_scattering(medium), medium, shape=shape, density=density)
    inside = read_medium(medium, name)
    return Cloud(inside.sigma_t, inside.albedo, inside.phase, inside.plugin, shape=shape)


def _camera_cloud(sensor, boundaries: list[Any], origin: Array) -> int:
    """Return in which cloud the camera is, and check that it says so itself."""
    number = _enclosing(boundaries, origin)
    own = sensor.get_medium()
    if number < 0 and own is not None:
        raise InputError("the camera references a medium and is in no cloud; remove the medium from the sensor")
    if number >= 0 and own != boundaries[number].interior_medium():
        raise InputError(
            f"the camera is inside of shape '{boundaries[number].id()}', but references another medium or none; "
            "reference that shape's interior medium in the sensor"
        )
    return number


def _enclosing(shapes: list[Any], point: Array) -> int:
    """Return the number of the closed surface around a point, (3,) [m], -1 if there is none.

    A ray from the point meets the surfaces that enclose it an odd number of times; the one met first from inside is it.
    """
    scene = scene_from(shapes)
    for direction in ((0.2672, 0.5345, 0.8018), (-0.6247, 0.3714, 0.6868)):
        ray = mi.Ray3f(mi.Point3f(*(float(c) for c in point)), mi.Vector3f(*direction))
        dr.make_opaque(ray)
        si = scene.ray_intersect(ray)
        dr.eval(si)
        if not bool(si.is_valid()[0]) or float(dr.dot(si.n, mi.Vector3f(*direction))[0]) <= 0:
            return -1
    hit = si.shape
    return next(number for number, shape in enumerate(shapes) if bool((hit == mi.ShapePtr(shape))[0]))
