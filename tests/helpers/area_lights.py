# SPDX-License-Identifier: BSD-3-Clause
"""Scenes with area lights, and their airlight."""

from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np

from airlight.reference.quadrature.area_lights import (
    AreaAirlight,
    area_airlight,
    beams_of,
    seen_samples,
    turn_of_sections,
)
from airlight.reference.quadrature.light_sections import sections_for_points
from airlight.reference.quadrature.replicates import REPLICATES, PointPlan, square_points
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.visibility.candidates import Ball
from airlight.reference.visibility.lit_intervals import before_light, obstacles
from airlight.validation.scenes.meshes import Mesh, placed, rotation, scaled, torus

BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0, 0.0, 0.0]}}
NULL = {"type": "null"}
GREY = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.5, 0.4]}}


def lamp(
    kind: str = "rectangle", *, radiance=(3.0, 2.0, 1.0), bsdf=None, **shape: Any
) -> dict[str, Any]:
    """Return an area light of this kind; `bsdf` is black by default."""
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
    return {"type": kind, "emitter": emitter, "bsdf": BLACK if bsdf is None else bsdf, **shape}


def mesh_lamp(mesh: Mesh, *, radiance=(3.0, 2.0, 1.0), bsdf=None, flipped: bool = False):
    """Return an area light on a mesh; `bsdf` is black by default."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(BLACK if bsdf is None else bsdf)
    properties["emitter"] = mi.load_dict(lamp(radiance=radiance)["emitter"])
    properties["flip_normals"] = flipped
    vertices, faces = mesh
    made = mi.Mesh("lamp", vertex_count=len(vertices), face_count=len(faces), props=properties)
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = mi.Float(vertices.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(faces.astype(np.uint32).ravel())
    parameters.update()
    return made


def ring(place=(0.3, 0.4, 2.9), *, size=1.0, **changes: Any):
    """Return a torus that hides parts of itself."""
    return mesh_lamp(
        placed(scaled(torus(0.4, 0.15, (18, 9)), size), place, rotation((1, 2, 3), 37.0)), **changes
    )


def fog(sigma_t=0.21, albedo=0.83) -> dict[str, Any]:
    """Return an unbounded medium."""
    return {
        "type": "homogeneous",
        "sigma_t": {"type": "rgb", "value": [sigma_t] * 3},
        "albedo": {"type": "rgb", "value": [albedo] * 3},
    }


def lit_scene(*, size=(4, 3), to_world=None, medium=None, **shapes: Any):
    """Return a Mitsuba scene with a camera in fog, looking along z from the origin by default."""
    medium = fog() if medium is None else medium
    sensor = {
        "type": "perspective",
        "fov": 60.0,
        "to_world": mi.ScalarTransform4f() if to_world is None else to_world,
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1]},
        "medium": medium,
    }
    return mi.load_dict({"type": "scene", "sensor": sensor, **shapes})


def turned(place, angle, scale):
    """Return a transformation that scales, turns by an angle [degrees] and moves to a place."""
    return (
        mi.ScalarTransform4f()
        .translate(list(place))
        .rotate([0.8, 0.6, 0.0], angle)
        .scale(list(scale))
    )


def flat(kind: str = "rectangle", **changes: Any) -> dict[str, Any]:
    """Return a rectangle or disk over the room that faces it."""
    return lamp(
        kind,
        to_world=turned((0.3, 0.4, 2.9), 163, (0.5, 0.5 if kind == "disk" else 0.3, 1.0)),
        **changes,
    )


def ball(**changes: Any) -> dict[str, Any]:
    """Return a sphere over the room."""
    return lamp("sphere", center=[0.3, 0.4, 2.9], radius=0.4, **changes)


def lit_room(light, *, size=(5, 4), medium=None, empty=False, **shapes: Any) -> ReferenceScene:
    """Return a floor with a leaning block and a ball under a light, seen from the
    side, or the light alone.
    """
    usual = {
        "floor": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(5.1), "bsdf": GREY},
        "block": {
            "type": "cube",
            "to_world": turned((0.4, 0.2, 0.9), 27, (0.4, 0.2, 0.3)),
            "bsdf": GREY,
        },
        "ball": {"type": "sphere", "center": [-0.6, 0.3, 0.6], "radius": 0.31, "bsdf": GREY},
    }
    shapes = ({} if empty else usual) | shapes
    camera = mi.ScalarTransform4f().look_at([0.2, -4.1, 1.9], [0.1, 0.0, 0.7], [0, 0, 1])
    chosen = {name: shape for name, shape in shapes.items() if shape is not None}
    return read_reference(
        lit_scene(size=size, to_world=camera, medium=medium, lamp=light, **chosen)
    )


def visible_fraction(reference: ReferenceScene, place, normal, samples: int):
    """Return the fraction of the area of the first, flat light that surface points see,
    (points, replicates) [1].

    A camera looks down on each point along its normal.
    """
    light, result = reference.area[0], np.zeros((len(place), REPLICATES))
    _, shapes = before_light(reference, light)
    normal = np.asarray(normal, dtype=float)
    for number, point in enumerate(np.asarray(place, dtype=float)):
        down = replace(reference, origin=point + normal, direction=-normal[None])
        known = obstacles(down, Ball(light.centre, light.radius), np.ones(1), shapes)
        for replicate in range(REPLICATES):
            plan = PointPlan(most=samples)
            square = square_points(plan, 0, replicate, light.kind)
            sections = sections_for_points(light, point[None], square, turn_of_sections(plan, 0))
            eye, of = (
                np.broadcast_to(point + 1e-6 * normal, (samples, 3)),
                np.zeros(samples, np.int64),
            )
            _, seen_at, angle = seen_samples(sections, eye, known, of, square[:, 1])
            way = point - seen_at
            r = np.linalg.norm(way, axis=1)
            result[number, replicate] = (
                (angle * r**3 / (way @ light.normal)).sum() / samples / light.area
            )
    return result


def fixed(points: int, seed: int = 0) -> PointPlan:
    """Return the plan of so many points for every ray."""
    return PointPlan(error=0.0, first=points, most=points, seed=seed)


def area_airlight_of(reference: ReferenceScene, plan: PointPlan, distance=None) -> AreaAirlight:
    """Return the airlight of the area lights of a scene along its rays up to their
    surfaces, or to a distance [m].
    """
    distance = surface_hits(reference).distance if distance is None else distance
    return area_airlight(
        reference, beams_of(reference, distance), np.zeros((len(distance), 3)), plan=plan
    )


def airlight_replicates(reference: ReferenceScene, plan: PointPlan, distance=None):
    """Return the same as replicates alone, (rays, 3, replicates) [W/(m^2 sr)]."""
    return area_airlight_of(reference, plan, distance).replicates
