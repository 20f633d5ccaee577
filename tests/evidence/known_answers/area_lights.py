# SPDX-License-Identifier: BSD-3-Clause
"""Laws and closed forms for lights with extent.

- Airlight is linear in albedo and radiance. With lengths times k and sigma_t over k it stays as it is: dA/r^2 has no
  unit, and sigma_t dx none either.
- Turning the whole scene changes nothing.
- A light that shrinks at equal power becomes a point light with a cosine, I = Le A cos, or a sphere a point light of
  intensity Le pi R^2. A rectangle that is symmetric about its middle differs from it by the square of its size.
- A sphere beside a ray in endless fog, and the share of a disk or a rectangle that a half plane or a triangle leaves,
  have closed forms (`analytic.area_light`).
"""

import math
from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.area_light import disk_share, polygon_in_disk, polygon_overlap, sphere_airlight
from reference.quadrature.area_surface import visible_share
from reference.quadrature.image import quadrature_image
from reference.quadrature.light_points import PointPlan
from reference.quadrature.ray_values import TruthImage, ray_values
from reference.scene.read import TruthLight, TruthScene, read_truth
from reference.visibility.light_lines import Points
from tests.evidence.certified.model import load_fog, mitsuba_dict
from tests.evidence.certified.scenes import fog_scenes
from tests.evidence.known_answers.record import EXACT, KnownAnswer, largest_difference

Array = NDArray[np.float64]

_POINTS = PointPlan(error=0.0, first=16, most=16)
_SIDES = (0.5, 0.25)
_PLACE = (1.375, 0.375, 2.25)  # of the lamp over the box, which it faces
_BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}


def area_answers() -> list[KnownAnswer]:
    """Return all known answers for lights with extent."""
    laws = (albedo_linear, radiance_linear, units, turned, shrinking_rectangle, shrinking_sphere)
    return [law() for law in (*laws, sphere_beside_rays, half_plane_before_disk, triangle_before_lights)]


def base_scene(kind: str = "rectangle", matrix: Array | None = None, *, camera: Array | None = None) -> dict[str, Any]:
    """Return the scene that the laws are tried on: a box on a floor, under a lamp.

    Parameters
    ----------
    kind
        Of the lamp.
    matrix
        Applied to the whole scene, (4, 4); the identity by default.
    camera
        Applied to the camera in its place, (4, 4), which can have no scale.
    """
    scene = replace(next(scene for scene in fog_scenes() if scene.name == "box-floor"), lights=())
    matrix = np.eye(4) if matrix is None else matrix
    entries = mitsuba_dict(replace(scene, sigma_t=(0.1875, 0.25, 0.375)))
    lamp = np.eye(4)
    # The third axis looks down and inwards; all numbers are multiples of 1/16.
    lamp[:3, :3] = np.array([[0.0, 0.6, -0.8], [1.0, 0.0, 0.0], [0.0, -0.8, -0.6]]) * [*_SIDES, 1.0]
    lamp[:3, 3] = _PLACE
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": [4.0, 3.0, 2.0]}}
    entries["lamp"] = {"type": kind, "to_world": {"matrix": lamp.tolist()}, "bsdf": _BLACK, "emitter": emitter}
    for name, entry in entries.items():
        if isinstance(entry, dict) and "to_world" in entry:
            applied = matrix if camera is None or name != "sensor" else camera
            moved = applied @ np.array(entry["to_world"]["matrix"])
            entries[name] = entry | {"to_world": {"matrix": moved.tolist()}}
    return entries


def albedo_linear() -> KnownAnswer:
    """Halve the albedo."""
    truth = _truth(base_scene())
    half = replace(truth, medium=replace(truth.medium, albedo=0.5 * truth.medium.albedo))
    return _compared("airlight of an area light is linear in the albedo", truth, half, 0.5)


def radiance_linear() -> KnownAnswer:
    """Multiply the radiance by 4."""
    truth = _truth(base_scene())
    light = replace(truth.area[0], radiance=4 * truth.area[0].radiance)
    return _compared("airlight of an area light is linear in its radiance", truth, replace(truth, area=(light,)), 4.0)


def units() -> KnownAnswer:
    """Measure lengths in units an eighth as long."""
    k = 8.0
    # A camera has no scale: only its place changes.
    scaled = base_scene(matrix=np.diag([k, k, k, 1.0]), camera=np.eye(4))
    place = np.array(scaled["sensor"]["to_world"]["matrix"])
    place[:3, 3] *= k
    scaled["sensor"] |= {"to_world": {"matrix": place.tolist()}}
    truth = _truth(scaled)
    truth = replace(truth, medium=replace(truth.medium, sigma_t=truth.medium.sigma_t / k))
    return _compared("airlight of an area light has no unit of length", _truth(base_scene()), truth, 1.0)


def turned() -> KnownAnswer:
    """Turn the scene by a third of a turn about (1, 1, 1): the axes change places, and no number is rounded."""
    turn = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    name = "a turn of the scene changes nothing under an area light"
    return _compared(name, _truth(base_scene()), _truth(base_scene(matrix=turn)), 1.0)


def shrinking_rectangle() -> KnownAnswer:
    """Shrink a lamp at equal power: half the size differs from the point by a quarter."""
    truth = _open(_truth(base_scene()))
    images = [_sized(truth, size) for size in (2.0**-4, 2.0**-5, 2.0**-12)]
    ratio = _distance(images[0], images[2]) / _distance(images[1], images[2])
    reason = "relative: the next term of the series, and that of the points"
    return KnownAnswer("a rectangle shrinks to a point", "quadrature", abs(ratio / 4 - 1), 0.05, reason)


def shrinking_sphere() -> KnownAnswer:
    """Shrink a sphere at equal power to a point light of intensity Le pi R^2."""
    radius = 2.0**-12
    truth = _open(_truth(base_scene()))
    light = replace(truth.area[0], kind="sphere", half=np.full(2, radius))
    plan = PointPlan(error=0.0, first=1024, most=1024)
    small = ray_values(replace(truth, area=(light,)), plan=plan).airlight
    point = _point_light(truth, light.centre, light.radiance * math.pi * radius**2)
    reason = "relative to the largest pixel: 8 x 1024 points"
    return KnownAnswer("a sphere shrinks to a point", "quadrature", largest_difference(small, point), 3e-4, reason)


def sphere_beside_rays() -> KnownAnswer:
    """Compare rays that pass a sphere with the closed form."""
    truth = _open(_truth(base_scene()))
    sigma_t, radius, foot = 0.21, 0.3, 2.0
    medium = replace(truth.medium, sigma_t=np.full(3, sigma_t), albedo=np.ones(3))
    plan, worst = PointPlan(error=0.0, first=16384, most=16384), 0.0
    light = replace(truth.area[0], kind="sphere", half=np.full(2, radius), radiance=np.ones(3), frame=np.eye(3))
    for height in (0.35, 0.83):
        light = replace(light, centre=np.array([height, 0.0, foot]))
        ray = replace(
            truth,
            area=(light,),
            medium=medium,
            origin=np.zeros(3),
            direction=np.array([[0.0, 0, 1]]),
            width=1,
            height=1,
        )
        value = ray_values(ray, plan=plan).airlight[0, 0]
        expected = sphere_airlight(sigma_t, height, radius, foot=foot, x0=0.0, x1=300.0) * sigma_t / (4 * math.pi)
        worst = max(worst, abs(float(value / expected) - 1))
    reason = "relative: 8 x 16384 points, whose standard error is 5e-7"
    return KnownAnswer("a sphere beside a ray", "quadrature", worst, 2e-6, reason)


def half_plane_before_disk(lines: int = 32768) -> KnownAnswer:
    """Cover a disk by a half plane, and compare shares with (acos u - u sqrt(1 - u^2))/pi."""
    return _shares("a half plane before a disk", "disk", np.array([[0.0, -64], [64, -64], [64, 64], [0, 64]]), lines)


def triangle_before_lights(lines: int = 32768) -> KnownAnswer:
    """Cover a rectangle by a triangle, and compare shares with those of clipped polygons."""
    triangle = np.array([[-0.25, -0.25], [0.5, 0.0], [0.125, 0.5]])
    return _shares("a triangle before a rectangle", "rectangle", triangle, lines)


def _shares(name: str, kind: str, corners: Array, lines: int) -> KnownAnswer:
    """Compare shares of a lamp at the height 4 over points at 0, where a polygon at the height 2 is in the way."""
    truth = _truth(base_scene() if kind == "rectangle" else _round(base_scene(kind)))
    half = np.array([0.625, 0.375]) if kind == "rectangle" else np.full(2, 0.5)
    middle = np.array([0.125, 0.25])
    frame = np.diag([1.0, 1.0, -1.0])
    light = replace(truth.area[0], centre=np.array([*middle, 4.0]), half=half, frame=frame)
    truth = replace(truth, area=(light,), occluders=_occluder(corners, 2.0))
    place = np.array([[-0.375, 0.25, 0], [-0.1875, 0.125, 0], [0.0, 0.0625, 0], [0.125, 0.25, 0], [0.3125, 0.125, 0]])
    points = Points(place, np.tile([0.0, 0.0, 1.0], (len(place), 1)))
    share = visible_share(truth, 0, points, lines).mean(axis=1)
    # A corner at half the height is twice as far from the foot of the point where it falls on the light's plane.
    expected = []
    for foot in place[:, :2]:
        fallen = foot + 2 * (corners - foot) - middle
        if len(corners) == 4:
            expected.append(1 - float(disk_share(fallen[0, 0] / half[0])))
        elif kind == "disk":
            expected.append(1 - polygon_in_disk(fallen / half[0]) / math.pi)
        else:
            sides = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
            expected.append(1 - polygon_overlap(fallen, sides) / (4 * half[0] * half[1]))
    difference = float(np.abs(share - np.array(expected)).max())
    reason = f"of the share: 8 x {lines} scan lines, whose error falls as N^-1.7"
    return KnownAnswer(name, "quadrature", difference, 1e-6 * max(1.0, 16384 / lines) ** 1.7, reason)


def _round(entries: dict[str, Any]) -> dict[str, Any]:
    matrix = np.array(entries["lamp"]["to_world"]["matrix"])
    matrix[:3, 1] *= _SIDES[0] / _SIDES[1]
    return entries | {"lamp": entries["lamp"] | {"to_world": {"matrix": matrix.tolist()}}}


def _occluder(corners: Array, height: float) -> Any:
    """Return a Mitsuba scene of one convex polygon, as a fan of triangles."""
    mesh = mi.Mesh("lid", vertex_count=len(corners), face_count=len(corners) - 2)
    parameters = mi.traverse(mesh)
    vertices = np.concatenate([corners, np.full((len(corners), 1), height)], axis=1)
    parameters["vertex_positions"] = vertices.astype(np.float32).ravel()
    parameters["faces"] = np.array([[0, k, k + 1] for k in range(1, len(corners) - 1)], dtype=np.uint32).ravel()
    parameters.update()
    return mi.load_dict({"type": "scene", "lid": mesh})


def _truth(entries: dict[str, Any]) -> TruthScene:
    return read_truth(load_fog(entries))


def _open(truth: TruthScene) -> TruthScene:
    """Return a scene without its occluders."""
    return replace(truth, occluders=load_fog({"type": "scene"}))


def _sized(truth: TruthScene, size: float) -> Array:
    """Return the airlight of the lamp at a share of its size and its whole power."""
    light = truth.area[0]
    light = replace(light, half=size * light.half, radiance=light.radiance / size**2)
    plan = PointPlan(error=0.0, first=256, most=256)
    return ray_values(replace(truth, area=(light,)), plan=plan).airlight


def _distance(first: Array, second: Array) -> float:
    return float(np.sqrt(np.mean((first - second) ** 2)))


def _point_light(truth: TruthScene, place: Array, intensity: Array) -> Array:
    return ray_values(replace(truth, area=(), lights=(TruthLight(place, intensity),))).airlight


def _compared(name: str, truth: TruthScene, changed: TruthScene, factor: float) -> KnownAnswer:
    images = [_image(changed).airlight, factor * _image(truth).airlight]
    return KnownAnswer(name, "quadrature", largest_difference(*images), *EXACT)


def _image(truth: TruthScene) -> TruthImage:
    return quadrature_image(truth, plan=_POINTS)
