# SPDX-License-Identifier: BSD-3-Clause
"""Reading a scene of clouds for the reference: media in closed meshes of any shape, whose light may
be scattered any number of times.

Clouds lie in vacuum, apart from one another. Suns are directional emitters, the sky is at most one
emitter of constant radiance. Other lights are refused by name. The density of a `heterogeneous`
cloud is Mitsuba's own volume, over its largest value.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.camera import (
    camera_matrix,
    film_directions,
    perspective_sensor,
    pixel_centres,
)
from airlight.reference.scene.directional_light import (
    DirectionalLight,
    is_directional,
    read_directional,
)
from airlight.reference.scene.homogeneous_medium import (
    ReferenceMedium,
    read_medium,
    read_scattering,
)
from airlight.reference.scene.shape_roles import scene_from, scene_of, sorted_shapes
from airlight.reference.scene.varying import grid_values

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CloudDensity:
    """The varying density of a cloud."""

    medium: "mi.Medium"
    largest: float  #: extinction [1/m]
    voxel: float  #: width of the grid's voxels along their shortest side, of a grid along axes [m]

    def at(self, point: "mi.Point3f", active: "mi.Bool | bool" = True) -> "mi.Float":
        """Return the extinction at places [m] over the largest one, 0 to 1."""
        place = dr.zeros(mi.MediumInteraction3f, dr.width(point))
        place.p = point
        _, _, sigma_t = self.medium.get_scattering_coefficients(place, active)
        return dr.clip(sigma_t[0] / self.largest, 0, 1)

    def along(self, origin: Array, way: Array, begin: Array, length: Array) -> Array:
        """Return the integral of the density over stretches of rays [m].

        `origin`: where all rays start, (3,) [m]; `way`: unit directions, (n, 3); `begin`, `length`:
        where stretches begin, and how long they are, (n,) [m].

        The midpoint rule with steps of an eighth of a voxel; Mitsuba's values are in float32.
        """
        if not len(way):
            return np.zeros(0)
        # Each stretch has its own number of steps; the loop ends for it when they are done.
        count = np.maximum(np.ceil(length / (0.125 * self.voxel)), 1.0)
        start = origin + way * begin[:, None]
        first, step = mi.Point3f(start.T), mi.Vector3f((way * (length / count)[:, None]).T)
        steps = mi.UInt32(count.astype(np.uint32))

        def add(number, total):
            return number + 1, total + mi.Float64(self.at(first + step * (mi.Float(number) + 0.5)))

        state = (dr.zeros(mi.UInt32, len(way)), dr.zeros(mi.Float64, len(way)))
        _, total = dr.while_loop(state=state, cond=lambda number, total: number < steps, body=add)
        return np.asarray(np.array(total) * (length / count))


@dataclass(frozen=True)
class Cloud(ReferenceMedium):
    """A medium within a closed surface."""

    shape: "mi.Shape"  #: what bounds it
    #: over `sigma_t`, the largest extinction; None for a homogeneous medium
    density: CloudDensity | None = None

    @property
    def name(self) -> str:
        """The id of the shape."""
        return str(self.shape.id())


@dataclass(frozen=True)
class CloudScene:
    """A scene of clouds as the reference sees it."""

    scene: "mi.Scene"  #: all shapes and lights
    bodies: "mi.Scene"  #: the opaque shapes and the boundaries of clouds: all that rays meet
    occluders: "mi.Scene"  #: the opaque shapes alone
    width: int  #: [pixels]
    height: int  #: [pixels]
    origin: Array  #: the pinhole [m], (3,)
    direction: Array  #: unit directions through the pixel centres, (pixels, 3), row by row
    clouds: tuple[Cloud, ...]
    suns: tuple[DirectionalLight, ...]
    sky: Array  #: radiance of the sky, RGB, zero without one [W/(m^2 sr)]
    camera_cloud: int  #: number of the cloud that the camera is in, -1 in vacuum


def read_clouds(scene: "mi.Scene") -> CloudScene:
    """Read a scene of clouds of the current RGB variant.

    Raises InputError for a scene without a cloud, or without a sun and a sky, and, by its name, for
    a light, a material or a medium that the walk cannot follow.
    """
    sensor = perspective_sensor(scene)
    # The light, then the shapes: opaque ones, and the boundaries of clouds.
    suns, sky = _lights(scene)
    opaque, boundaries = sorted_shapes(scene)
    if not boundaries:
        raise InputError(
            "the scene has no cloud; expected a closed shape of material 'null' with an interior "
            "medium"
        )
    # Paths find a sun by the material's value for its direction, which a mirror does not have.
    for shape in opaque:
        if mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Delta):
            raise InputError(
                f"shape '{shape.id()}' has a {shape.bsdf().class_name()} material, a mirror: paths "
                "cannot find the sun in it; expected a rough one"
            )
    # For the walk all space outside of clouds is vacuum.
    for shape in boundaries:
        if shape.exterior_medium() is not None:
            raise InputError(
                f"the exterior medium of shape '{shape.id()}' is not vacuum; expected none around "
                "clouds"
            )
    clouds = tuple(_read_cloud(shape) for shape in boundaries)
    width, height = (int(n) for n in sensor.film().size())
    origin = camera_matrix(sensor)[:3, 3]
    return CloudScene(
        scene=scene,
        bodies=scene_of([*opaque, *boundaries], scene),
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


def _lights(scene: "mi.Scene") -> tuple[tuple[DirectionalLight, ...], Array]:
    suns, skies = [], []
    for emitter in scene.emitters():
        if is_directional(emitter):
            suns.append(read_directional(emitter))
        elif emitter.class_name() == "ConstantBackgroundEmitter":
            # A sky has one number or three.
            given = np.array(mi.traverse(emitter)["radiance.value"], dtype=np.float64).reshape(-1)
            skies.append(np.broadcast_to(given, 3))
        else:
            raise InputError(
                f"light '{emitter.id()}' is a {emitter.class_name()}; clouds are lit by emitters "
                "of type 'directional' and 'constant'"
            )
    if len(skies) > 1:
        raise InputError(
            f"the scene has {len(skies)} emitters of type 'constant'; expected at most one sky"
        )
    if not suns and not skies:
        raise InputError(
            "the scene has no light; expected an emitter of type 'directional' or 'constant'"
        )
    return tuple(suns), skies[0] if skies else np.zeros(3)


def _read_cloud(shape: "mi.Shape") -> Cloud:
    medium, name = shape.interior_medium(), f"the medium of shape '{shape.id()}'"
    if not medium.is_homogeneous():
        # The largest extinction stands for the cloud, and the density is relative to it.
        density = _read_density(shape, name)
        sigma_t = np.full(3, density.largest)
        return Cloud(sigma_t, *read_scattering(medium), medium, shape=shape, density=density)
    inside = read_medium(medium, name)
    return Cloud(inside.sigma_t, inside.albedo, inside.phase, inside.plugin, shape=shape)


def _camera_cloud(sensor: "mi.Sensor", boundaries: "list[mi.Shape]", origin: Array) -> int:
    """Return the number of the cloud that the camera is in, -1 in vacuum, and check that the sensor
    references the medium of that cloud.
    """
    number = _enclosing(boundaries, origin)
    camera_medium = sensor.get_medium()
    if number < 0 and camera_medium is not None:
        raise InputError(
            "the camera references a medium and is in no cloud; remove the medium from the sensor"
        )
    if number >= 0 and camera_medium != boundaries[number].interior_medium():
        raise InputError(
            f"the camera is inside of shape '{boundaries[number].id()}', but references another "
            "medium or none; reference that shape's interior medium in the sensor"
        )
    return number


def _enclosing(shapes: "list[mi.Shape]", point: Array) -> int:
    """Return the number of the closed surface around a point, (3,) [m], -1 if there is none.

    Surfaces lie apart from one another: a ray from a point that is enclosed first meets the surface
    around the point, from inside.
    """
    # Only boundaries are in this scene: an opaque shape must not hide one from the rays.
    scene = scene_from(shapes)
    for direction in ((0.2672, 0.5345, 0.8018), (-0.6247, 0.3714, 0.6868)):
        ray = mi.Ray3f(mi.Point3f(*point.tolist()), mi.Vector3f(*direction))
        dr.make_opaque(ray)
        si = scene.ray_intersect(ray)
        dr.eval(si)
        # One direction could meet an edge; the point is outside if either ray leaves the shapes or
        # meets the first face from outside.
        if not bool(si.is_valid()[0]) or float(dr.dot(si.n, mi.Vector3f(*direction))[0]) <= 0:
            return -1
    # The second ray tells which surface it is.
    hit = si.shape
    return next(
        number for number, shape in enumerate(shapes) if bool((hit == mi.ShapePtr(shape))[0])
    )


def _read_density(shape: "mi.Shape", name: str) -> CloudDensity:
    """Return the density within a shape; messages call its medium by `name`.

    Raises InputError unless the extinction is a grid that covers the shape, of one channel, whose
    values are finite, 0 or more, and not all 0.
    """
    medium = shape.interior_medium()
    parameters = mi.traverse(medium)
    for key, value in (
        ("sigma_t.data", "a grid as its extinction"),
        ("albedo.value.value", "one albedo everywhere"),
    ):
        if key not in parameters:
            raise InputError(
                f"{name} is heterogeneous without {value}; the reference of clouds wants one"
            )
    values, low, high = grid_values(medium, name)
    box = shape.bbox()
    # A shape may reach beyond its grid by 1e-4 of it, for rounding.
    margin = 1e-4 * (high - low)
    if np.any(np.array(box.min).ravel() < low - margin) or np.any(
        np.array(box.max).ravel() > high + margin
    ):
        raise InputError(
            f"{name} has a grid that does not cover the shape: it reaches from {_words(low)} to "
            f"{_words(high)}; expected a to_world of the volume whose unit cube holds the shape"
        )
    # The table has the order z, y, x, the box x, y, z.
    voxel = float(((high - low) / values.shape[2::-1]).min())
    return CloudDensity(medium, float(values.max()), voxel)


def _words(point: Array) -> str:
    return f"({', '.join(f'{x:.6g}' for x in point)})"
