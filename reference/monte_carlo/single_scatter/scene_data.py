# SPDX-License-Identifier: BSD-3-Clause
"""What the integrator `single-scatter` must know of a scene: where lights are, what bounds media, what it refuses.

`reference.scene.read` reads the same scene for the quadrature; the two share no code. Here the emitters, phase
functions and media stay Mitsuba's own and are asked for their answers while rays are traced.
"""

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from analytic.errors import InputError
from reference.monte_carlo.single_scatter.area_sampling import AreaLight, is_area, read_area
from reference.monte_carlo.single_scatter.boundary_walk import (
    Surroundings,
    coefficients,
    read_surroundings,
    require_homogeneous,
)
from reference.monte_carlo.single_scatter.density_grid import read_majorant
from reference.monte_carlo.single_scatter.directional_sampling import is_sky
from reference.monte_carlo.single_scatter.height_fog import HeightDensity, read_height_density


@dataclass(frozen=True)
class Light:
    """A light as far as sampling must know it; what it sends where is the emitter's answer."""

    emitter: Any  #: Mitsuba's emitter
    position: Any  #: of double precision [m]
    axis: Any = None  #: spot: unit vector of double precision
    cutoff: float = math.pi  #: spot: half angle of the cone [rad]


@dataclass(frozen=True)
class Task:
    """What is fixed while a scene is traced."""

    around: Surroundings  #: what rays can meet
    lights: tuple[Light, ...]  #: point and spot lights
    far: tuple[Any, ...]  #: Mitsuba's emitters from infinity: suns, and a uniform sky
    samples: int  #: distances for each ray, light and medium
    grey: bool  #: no medium's extinction depends on the channel
    area: tuple[AreaLight, ...] = ()  #: lights with extent
    fog: HeightDensity | None = None  #: what camera rays start in, where that is height fog
    majorant: float = 0.0  #: the largest extinction of what camera rays start in, where that is a density grid [1/m]


def read_task(scene, medium, samples: int) -> Task:
    """Read what the estimator needs from a Mitsuba scene.

    `scene`: the `mi.Scene`; `medium`: what camera rays start in: a Mitsuba medium, a pointer to one, or None for a
    vacuum; `samples`: distances for each ray, light and medium. Raises InputError for an emitter, a medium or a
    material that it has no answer for.
    """
    far = tuple(emitter for emitter in scene.emitters() if _is_far(emitter))
    area = tuple(read_area(emitter) for emitter in scene.emitters() if is_area(emitter))
    lights = tuple(_read_light(emitter) for emitter in scene.emitters() if not (_is_far(emitter) or is_area(emitter)))
    around, media = read_surroundings(scene)
    own = medium if isinstance(medium, mi.Medium) else None
    fog, majorant = read_height_density(own) if own else None, read_majorant(own) if own else 0.0
    if fog is not None or majorant:
        return Task(around, lights, far, samples, grey=True, area=area, fog=fog, majorant=majorant)
    if isinstance(medium, mi.Medium):
        require_homogeneous(medium)
        media = [*media, medium]
    if far:
        _refuse_endless(scene, medium, far[0])
    known = medium is None or isinstance(medium, mi.Medium)
    return Task(around, lights, far, samples, grey=known and all(_is_grey(each) for each in media), area=area)


def _refuse_endless(scene, medium, emitter) -> None:
    """Refuse a medium without bounds: what camera rays start in where nothing bounds it, or the exterior of a bound."""
    inside = [shape.interior_medium() for shape in scene.shapes()]
    around = [shape.exterior_medium() for shape in scene.shapes()]
    if isinstance(medium, mi.Medium) and medium not in inside:
        around.append(medium)
    for outside in around:
        if outside is None:
            continue
        _, sigma_t = coefficients(mi.MediumPtr(outside), mi.Bool(True))
        kind = "a sky" if is_sky(emitter) else "directional"
        if max(float(np.ravel(channel)[0]) for channel in sigma_t):
            raise InputError(
                f"single-scatter: light '{emitter.id()}' is {kind}: nothing of it arrives through a medium "
                "without bounds; give the medium bounds, a closed shape of material 'null' with the medium as its "
                "interior"
            )


def _is_far(emitter) -> bool:
    return is_sky(emitter) or str(emitter.class_name()) == "DirectionalEmitter"


def _is_grey(medium) -> bool:
    _, sigma_t = coefficients(mi.MediumPtr(medium), mi.Bool(True))
    dr.eval(sigma_t)
    return len({float(np.ravel(channel)[0]) for channel in sigma_t}) == 1


def _read_light(emitter) -> Light:
    name = emitter.class_name()
    if name not in ("PointLight", "SpotLight"):
        raise InputError(
            f"single-scatter: the scene has an emitter of class {name}; wanted 'point', 'spot', 'directional', "
            "'area' or 'constant' only"
        )
    sample, _ = emitter.sample_direction(dr.zeros(mi.Interaction3f), mi.Point2f(0.5))
    position = mi.Point3d(sample.p)
    if name == "PointLight":
        return Light(emitter, position)
    axis = dr.normalize(mi.Vector3d(emitter.world_transform() @ mi.Vector3f(0, 0, 1)))
    cutoff = float(np.ravel(mi.traverse(emitter)["cutoff_angle"])[0])
    return Light(emitter, position, axis, math.radians(cutoff))
