# SPDX-License-Identifier: BSD-3-Clause
"""Laws that images of airlight obey exactly, and scenes whose answer is known in closed form.

With L = albedo sigma_t / (4 pi) int I p exp(-sigma_t (x + r)) / r^2 dx, summed over lights and lit intervals:

- L is linear in albedo and intensity, and adds up over lights.
- Lengths times k and sigma_t over k leave the exponent; of the rest sigma_t gives 1/k, dx/r^2 another: L falls as k^-2.
- Moving, turning or mirroring the whole scene changes nothing but the order of the pixels.
- As sigma_t goes to 0, L / (albedo sigma_t I / (4 pi)) goes to int dx / r^2 = (theta1 - theta0)/h, theta the angle at
  the light.
- **Fluence of first order.** Around an isotropic source of unit power in an unbounded medium of isotropic scattering
  the airlight that arrives from all directions at distance r adds up to

      phi = int albedo sigma_t exp(-sigma_t (r1 + r2)) / ((4 pi r1^2) r2^2 4 pi) dV,

  r1 and r2 the distances of dV from source and point. In prolate spheroidal coordinates, r1 + r2 = r xi and
  r1 - r2 = r eta, dV = r^3/8 (xi^2 - eta^2) dxi deta dphi and r1 r2 = r^2/4 (xi^2 - eta^2). The integral over eta is
  elementary, and with u = r xi

      phi = albedo sigma_t / (4 pi r) int_r^inf exp(-sigma_t u) log((u + r)/(u - r)) / u du.

- An absorbing medium has no airlight and dims a surface by exp(-sigma_t path); the path through a sphere of radius R is
  a chord of length 2 sqrt(R^2 - b^2), b the distance of its centre from the ray.
- A light in a closed box gives exactly nothing outside.
- What directional lights obey is in `tests.evidence.known_answers.directional`, lights with extent in
  `tests.evidence.known_answers.area_lights`.

Scale factors are powers of two and coordinates multiples of 1/1024, so that float32 scenes obey the laws exactly, too.
Monte Carlo estimators are held against them with the same random numbers on both sides.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from analytic.geometry import foot_and_height
from reference.quadrature.image import quadrature_image
from reference.quadrature.ray_values import ray_values
from reference.scene.read import TruthScene, read_truth
from tests.evidence.certified.model import (
    SIZE,
    FogBox,
    FogLight,
    FogScene,
    FogScreen,
    FogSphere,
    Matrix,
    load_fog,
    mitsuba_dict,
)
from tests.evidence.certified.scenes import fog_scenes
from tests.evidence.known_answers.area_lights import area_answers
from tests.evidence.known_answers.directional import directional_answers
from tests.evidence.known_answers.record import ESTIMATORS, EXACT, FLOAT32, KnownAnswer, largest_difference, layers

Array = NDArray[np.float64]


def base_scene() -> FogScene:
    """Return the scene that the laws are tried on: a box on a floor, a point light and a soft spot."""
    scenes = {scene.name: scene for scene in fog_scenes()}
    soft = scenes["soft-spot"].lights[0]
    return replace(scenes["box-floor"], lights=(*scenes["box-floor"].lights, soft), sigma_t=(0.1875, 0.25, 0.375))


def known_answers() -> list[KnownAnswer]:
    """Return all known answers, for each estimator as far as the law is exact for it."""
    answers = [law(estimator) for law in (albedo_linear, intensity_linear, units, enclosed) for estimator in ESTIMATORS]
    quadrature = (lights_add_up, turned, moved, mirrored, vacuum_limit, vacuum, fluence, absorbing_medium)
    answers += [law() for law in quadrature]
    answers += [absorbing_sphere(estimator) for estimator in ("quadrature", "single-scatter")]
    return answers + directional_answers() + area_answers()


def albedo_linear(estimator: str = "quadrature") -> KnownAnswer:
    """Halve the albedo."""
    scene = base_scene()
    half = replace(scene, albedo=tuple(value / 2 for value in scene.albedo))
    return _compared("airlight is linear in the albedo", estimator, scene, half, factor=0.5)


def intensity_linear(estimator: str = "quadrature") -> KnownAnswer:
    """Multiply all intensities by 4."""
    scene = base_scene()
    lights = tuple(replace(light, intensity=tuple(4 * value for value in light.intensity)) for light in scene.lights)
    return _compared("airlight is linear in the intensity", estimator, scene, replace(scene, lights=lights), factor=4)


def units(estimator: str = "quadrature") -> KnownAnswer:
    """Measure lengths in units an eighth as long."""
    k = 8
    scene = base_scene()
    scaled = _mapped(scene, np.diag([k, k, k, 1.0]))
    scaled = replace(scaled, camera=_rescaled(scaled.camera, k), sigma_t=tuple(value / k for value in scene.sigma_t))
    lights = tuple(replace(light, matrix=light.matrix and _rescaled(light.matrix, k)) for light in scaled.lights)
    return _compared("airlight falls as k^-2", estimator, scene, replace(scaled, lights=lights), factor=1 / k**2)


def lights_add_up() -> KnownAnswer:
    """Add the images of one light each."""
    scene = base_scene()
    parts = sum(_airlight(replace(scene, lights=(light,)), "quadrature") for light in scene.lights)
    difference = largest_difference(_airlight(scene, "quadrature"), np.asarray(parts))
    return KnownAnswer(
        "airlight adds up over lights", "quadrature", difference, 1e-13, "the same sums in another order"
    )


def turned() -> KnownAnswer:
    """Turn the scene by a third of a turn about (1, 1, 1): the axes change places, and no number is rounded."""
    turn = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    scene = base_scene()
    return _compared("a turn of the scene changes nothing", "quadrature", scene, _mapped(scene, turn))


def moved() -> KnownAnswer:
    """Move the scene by whole metres."""
    move = np.eye(4)
    move[:3, 3] = 3.0, -5.0, 2.0
    scene = base_scene()
    return _compared("a shift of the scene changes nothing", "quadrature", scene, _mapped(scene, move))


def mirrored() -> KnownAnswer:
    """Mirror the scene in x = 0: the image is mirrored, with a camera whose left stays left."""
    mirror = np.diag([-1.0, 1, 1, 1])
    scene = base_scene()
    image = _mapped(scene, mirror)
    image = replace(
        image,
        camera=_handed(image.camera),
        lights=tuple(replace(light, matrix=light.matrix and _handed(light.matrix)) for light in image.lights),
    )
    expected = _airlight(scene, "quadrature").reshape(SIZE, SIZE, 3)[:, ::-1]
    difference = largest_difference(_airlight(image, "quadrature"), expected.reshape(-1, 3))
    return KnownAnswer("a mirrored scene has a mirrored image", "quadrature", difference, *EXACT)


def vacuum_limit() -> KnownAnswer:
    """Compare with (theta1 - theta0)/h where the medium is all but gone and nothing casts a shadow."""
    sigma_t = 2.0**-40
    floor = base_scene().occluders[:1]
    scene = replace(base_scene(), lights=base_scene().lights[:1], occluders=floor, sigma_t=(sigma_t,) * 3)
    truth = read_truth(load_fog(mitsuba_dict(scene)))
    image = quadrature_image(truth)
    light = truth.lights[0]
    foot, height = foot_and_height(truth.origin, truth.direction, light.position)
    end = _floor_distance(truth)
    theta1 = np.where(np.isfinite(end), np.arctan2(np.where(np.isfinite(end), end, 0) - foot, height), math.pi / 2)
    expected = (theta1 - np.arctan2(-foot, height)) / height
    factor = truth.medium.albedo * sigma_t * light.intensity / (4 * math.pi)
    difference = float(np.max(np.abs(image.airlight.reshape(-1, 3) / (expected[:, None] * factor) - 1)))
    reason = "relative in each pixel: tolerance of the integrals; the medium itself is worth 1e-11"
    return KnownAnswer("the limit of a vacuum", "quadrature", difference, 2e-10, reason)


def vacuum() -> KnownAnswer:
    """Take the medium away."""
    image = _airlight(replace(base_scene(), sigma_t=(0.0, 0.0, 0.0)), "quadrature")
    return KnownAnswer("no airlight in a vacuum", "quadrature", float(np.abs(image).max()), 0.0, "exactly zero")


def fluence() -> KnownAnswer:
    """Add up the airlight over all directions around points at three distances from a source of unit power.

    With psi the angle from the direction of the source, phi = 2 pi int L sin(psi) dpsi. L grows as 1/psi towards the
    source; in psi = pi t^2 the integrand is smooth enough for 96 Gauss-Legendre nodes.
    """
    nodes, weights = np.polynomial.legendre.leggauss(96)
    t = 0.5 * (nodes + 1)
    psi = math.pi * t**2
    albedo, sigma_t = 0.75, 1.0
    light = FogLight((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    scene = replace(base_scene(), lights=(light,), occluders=(), sigma_t=(sigma_t,) * 3, albedo=(albedo,) * 3)
    truth = read_truth(load_fog(mitsuba_dict(scene)))
    directions = np.stack([np.sin(psi), np.zeros_like(psi), np.cos(psi)], axis=1)
    worst = 0.0
    for r in (0.25, 1.0, 3.0):
        around = replace(truth, origin=np.array([0.0, 0.0, -r]), direction=directions, width=len(psi), height=1)
        values = ray_values(around).airlight[:, 0] / truth.lights[0].intensity[0] / (4 * math.pi)
        flux = 2 * math.pi * float(np.sum(values * np.sin(psi) * weights * math.pi * t))

        def integrand(v: float, r: float = r) -> float:  # u = r (1 + v^2) takes the logarithm off the end
            return math.exp(-sigma_t * r * (1 + v * v)) * math.log((2 + v * v) / (v * v)) / (1 + v * v) * 2 * v

        integral = quad(integrand, 0, 1, epsrel=1e-12)[0] + quad(integrand, 1, np.inf, epsrel=1e-12)[0]
        worst = max(worst, abs(flux / (albedo * sigma_t / (4 * math.pi * r) * integral) - 1))
    return KnownAnswer("fluence of first order", "quadrature", worst, 1e-6, "relative: 96 directions")


def absorbing_medium() -> KnownAnswer:
    """Look at a floor through a medium that absorbs: exp(-sigma_t (camera to floor + floor to light))."""
    sigma_t = 0.75
    scene = replace(base_scene(), lights=base_scene().lights[:1], occluders=base_scene().occluders[:1])
    clear, dim = (
        read_truth(load_fog(_white(mitsuba_dict(replace(scene, sigma_t=(value,) * 3, albedo=(0.0,) * 3)))))
        for value in (0.0, sigma_t)
    )
    end = _floor_distance(clear)
    hit = np.isfinite(end)
    point = clear.origin + end[hit, None] * clear.direction[hit]
    path = end[hit] + np.linalg.norm(point - clear.lights[0].position, axis=1)
    seen = [quadrature_image(truth) for truth in (clear, dim)]
    ratio = seen[1].surface.reshape(-1, 3)[hit] / seen[0].surface.reshape(-1, 3)[hit]
    # The floor is met at (corner - origin) . n / (direction . n) in float32. Dot products and quotient round seven
    # times, a distance d is off by that share of d, and the path from light to camera by twice as much at most.
    off = np.abs(ratio / np.exp(-sigma_t * path)[:, None] - 1) / (2 * sigma_t * end[hit, None])
    difference = float(np.max(off)) + float(seen[1].airlight.max())
    reason = "of the distance to the surface, which is met in float32 with seven roundings"
    return KnownAnswer("an absorbing medium", "quadrature", difference, 7 * 2.0**-24, reason)


def absorbing_sphere(estimator: str = "quadrature") -> KnownAnswer:
    """Look at a wall through a sphere that absorbs, its light beside the wall: exp(-sigma_t chord)."""
    sigma_t, centre, radius = 0.75, np.array([0.125, 0.0625, 1.25]), 0.75
    scene = _wall_scene()
    clear = _white(mitsuba_dict(scene))
    del clear["fog"], clear["sensor"]["medium"]
    medium = mitsuba_dict(replace(scene, sigma_t=(sigma_t,) * 3, albedo=(0.0,) * 3))["fog"]
    sphere = {
        "type": "sphere",
        "center": centre.tolist(),
        "radius": radius,
        "bsdf": {"type": "null"},
        "interior": medium,
    }
    empty = sphere | {"interior": medium | {"sigma_t": {"type": "rgb", "value": [0.0, 0.0, 0.0]}}}
    images = []
    for inside in (empty, sphere):
        truth = read_truth(load_fog(clear | {"sphere": inside}))
        images.append(layers(truth, estimator)[1])
    towards = centre - truth.origin
    closest = np.linalg.norm(np.cross(towards, truth.direction), axis=1)
    chord = 2 * np.sqrt(np.maximum(radius**2 - closest**2, 0))
    difference = float(np.max(np.abs(images[1] / images[0] / np.exp(-sigma_t * chord)[:, None] - 1)))
    bound, reason = (1e-6, "relative: float32 sphere") if estimator == "quadrature" else FLOAT32
    return KnownAnswer("an absorbing sphere", estimator, difference, bound, reason)


def enclosed(estimator: str = "quadrature") -> KnownAnswer:
    """Put a box around the light."""
    light = FogLight((0.125, 0.25, 1.0), (8.0, 8.0, 8.0))
    box = FogBox((0.125, 0.25, 1.0), ((0.25, 0.0625, 0.0), (-0.0625, 0.25, 0.03125), (0.0, 0.0, 0.25)))
    scene = replace(base_scene(), lights=(light,), occluders=(*base_scene().occluders[:1], box))
    most = np.abs(layers(read_truth(load_fog(_white(mitsuba_dict(scene)))), estimator)).max()
    return KnownAnswer("a light in a closed box", estimator, float(most), 0.0, "exactly zero, surfaces included")


def _compared(name: str, estimator: str, scene: FogScene, changed: FogScene, *, factor: float = 1.0) -> KnownAnswer:
    difference = largest_difference(_airlight(changed, estimator), factor * _airlight(scene, estimator))
    return KnownAnswer(name, estimator, difference, *(EXACT if estimator == "quadrature" else FLOAT32))


def _airlight(scene: FogScene, estimator: str) -> Array:
    return layers(read_truth(load_fog(mitsuba_dict(scene))), estimator)[0]


def _mapped(scene: FogScene, matrix: Array) -> FogScene:
    """Apply an affine map to everything in a scene."""

    def point(values: Sequence[float]) -> tuple[float, ...]:
        return tuple(float(v) for v in matrix[:3, :3] @ values + matrix[:3, 3])

    def edges(values: Sequence[Sequence[float]]) -> Any:
        return tuple(tuple(float(v) for v in matrix[:3, :3] @ edge) for edge in values)

    def placed(shape: FogSphere | FogBox | FogScreen) -> FogSphere | FogBox | FogScreen:
        if isinstance(shape, FogSphere):
            raise TypeError("spheres are met in float32; the laws are tried on polygons")
        return replace(shape, centre=point(shape.centre), half_edges=edges(shape.half_edges))

    lights = tuple(
        replace(light, position=point(light.position), matrix=light.matrix and _rows(matrix @ np.array(light.matrix)))
        for light in scene.lights
    )
    camera = _rows(matrix @ np.array(scene.camera))
    return replace(scene, camera=camera, lights=lights, occluders=tuple(placed(shape) for shape in scene.occluders))


def _rows(matrix: Array) -> Matrix:
    return tuple(tuple(float(value) for value in row) for row in matrix)


def _rescaled(matrix: Matrix, k: float) -> Matrix:
    """Take the scale out of the rotation of a camera or a spot."""
    changed = np.array(matrix)
    changed[:3, :3] /= k
    return _rows(changed)


def _handed(matrix: Matrix) -> Matrix:
    """Turn the first axis of a mirrored camera or spot, so that it is a rotation again."""
    changed = np.array(matrix)
    changed[:3, 0] *= -1
    return _rows(changed)


def _floor_distance(truth: TruthScene) -> Array:
    """Return where rays meet the floor z = 0, a parallelogram wide enough for all that the tests look at."""
    with np.errstate(divide="ignore"):
        distance = -truth.origin[2] / truth.direction[:, 2]
    point = truth.origin + np.where(distance > 0, distance, 0)[:, None] * truth.direction
    floor = base_scene().occluders[0]
    assert isinstance(floor, FogScreen)
    u, v = (np.array(edge[:2]) for edge in floor.half_edges)
    share = np.linalg.solve(np.stack([u, v], axis=1), (point[:, :2] - np.array(floor.centre[:2])).T)
    return np.where((distance > 0) & np.all(np.abs(share) < 1, axis=0), distance, np.inf)


def _white(scene: dict[str, Any]) -> dict[str, Any]:
    """Return a dictionary whose occluders reflect half of the light."""
    half = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.5, 0.5]}}
    return {name: entry | {"bsdf": half} if name.startswith("occluder") else entry for name, entry in scene.items()}


def _wall_scene() -> FogScene:
    """Return a wall that fills the view and a light just before it, out of the view, in clear air."""
    wall = FogScreen((0.0, 6.0, 1.0), ((8.0, 0.0, 0.0), (0.0, 0.0, 8.0)))
    light = FogLight((0.0, 5.0, 6.0), (9.0, 9.0, 9.0))
    return replace(base_scene(), lights=(light,), occluders=(wall,))
