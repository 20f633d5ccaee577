# SPDX-License-Identifier: BSD-3-Clause
r"""Claim: images of the reference obey exact laws, and have the known answer where there is one.

With L = albedo sigma_t / (4 pi) int I p exp(-sigma_t (x + r)) / r^2 dx, summed over
lights and lit intervals:

- L is linear in the albedo and in what lights send, and adds up over lights.
- Lengths times k and sigma_t over k leave the exponent; of the rest sigma_t gives 1/k and dx/r^2
  another: L falls as k^-2. A directional light has no 1/r^2, and of an area light dA/r^2 has no
  unit: there L stays as it is.
- Moving, turning or mirroring the whole scene changes nothing but the order of the pixels.
- A light in a closed box gives exactly nothing outside.

Monte Carlo estimators are held against the laws with the same random numbers on both sides.
"""

import math
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad

from airlight.analytic.geometry import foot_and_height
from airlight.reference.quadrature.image import ray_values
from airlight.reference.quadrature.replicates import PointPlan
from tests.evidence.certified.model import SIZE, FogLight, load_fog, mitsuba_dict
from tests.evidence.closed_forms import disk_fraction, polygon_in_disk, polygon_overlap
from tests.evidence.known_answers import (
    BOX,
    SCENES,
    TURN,
    G,
    airlight,
    brighter,
    darker,
    difference,
    enclosed,
    floor,
    fog_scene,
    in_units,
    lamps,
    layers,
    mapped,
    one_light_each,
    panel,
    reference_of,
    sun,
    white,
)
from tests.helpers.area_lights import visible_fraction

EXACT = 1e-10  # the tolerance of the integrals
# of single precision, which rounds otherwise after a change; the random numbers are the same
FLOAT32 = 2e-5

MOVE = np.eye(4)
MOVE[:3, 3] = 3.0, -5.0, 2.0

#: By law: what it does to a scene, and by what factor it changes the airlight of each scene.
LINEAR = {
    "albedo": (lambda scene: darker(scene, 0.5), dict.fromkeys(SCENES, 0.5)),
    "power": (lambda scene: brighter(scene, 4.0), dict.fromkeys(SCENES, 4.0)),
    "units": (lambda scene: in_units(scene, 8.0), {"lamps": 1 / 64, "sun": 1.0, "panel": 1.0}),
}
SAME = {"turned": TURN, "moved": MOVE}


def law(name: str, scene: str, estimator: str = "quadrature") -> float:
    """Return how far images are from a law, over the largest pixel."""
    change, factor = LINEAR[name]
    before = SCENES[scene]()
    return difference(
        airlight(change(before), estimator), factor[scene] * airlight(before, estimator)
    )


def additivity(scene) -> float:
    return difference(
        airlight(scene), np.asarray(sum(airlight(one) for one in one_light_each(scene)))
    )


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", LINEAR)
def test_quadrature_obeys(variant, name, scene):
    assert law(name, scene) <= EXACT


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("scene", ["lamps", "sun"])
@pytest.mark.parametrize("name", LINEAR)
@pytest.mark.parametrize(
    "estimator", ["single-scatter", pytest.param("volpath", marks=pytest.mark.slow)]
)
def test_monte_carlo_obeys(variant, name, scene, estimator):
    assert law(name, scene, estimator) <= FLOAT32


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", SAME)
def test_a_scene_can_be_elsewhere(variant, name, scene):
    before = SCENES[scene]()
    assert difference(airlight(mapped(before, SAME[name])), airlight(before)) <= EXACT


@pytest.mark.claim("known-answers")
def test_a_mirrored_scene_has_a_mirrored_image(variant):
    mirrored = airlight(mapped(lamps(), np.diag([-1.0, 1, 1, 1]))).reshape(SIZE, SIZE, 3)
    assert difference(mirrored[:, ::-1], airlight(lamps()).reshape(SIZE, SIZE, 3)) <= EXACT


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("name", ["lamps", "sun"])
def test_lights_add_up(variant, name):
    lamp = {
        "type": "point",
        "position": [0.5, -0.25, 2.5],
        "intensity": {"type": "rgb", "value": [5.0, 6.0, 7.0]},
    }
    scene = lamps() if name == "lamps" else sun() | {"lamp": lamp}
    assert len(one_light_each(scene)) == 2
    assert additivity(scene) <= 1e-13  # the same sums in another order


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("name", ["lamps", "sun"])
@pytest.mark.parametrize(
    "estimator", ["quadrature", "single-scatter", pytest.param("volpath", marks=pytest.mark.slow)]
)
def test_no_light_leaves_a_closed_box(variant, name, estimator):
    assert np.abs(layers(reference_of(enclosed(name)), estimator)).max() == 0


# --- Closed forms: media ---


def floor_distance(reference) -> np.ndarray:
    """Return where rays meet the floor z = 0, a parallelogram."""
    with np.errstate(divide="ignore"):
        distance = -reference.origin[2] / reference.direction[:, 2]
    point = reference.origin + np.where(distance > 0, distance, 0)[:, None] * reference.direction
    u, v = (np.array(edge[:2]) for edge in floor().half_edges)
    fraction = np.linalg.solve(
        np.stack([u, v], axis=1), (point[:, :2] - np.array(floor().centre[:2])).T
    )
    return np.where((distance > 0) & np.all(np.abs(fraction) < 1, axis=0), distance, np.inf)


@pytest.mark.claim("known-answers")
def test_the_limit_of_a_vacuum(variant):
    """As sigma_t goes to 0, L / (albedo sigma_t I / (4 pi)) goes to int dx /
    r^2 = (theta1 - theta0)/h.
    """
    sigma_t = 2.0**-40
    reference = reference_of(
        replace(
            fog_scene(), lights=fog_scene().lights[:1], occluders=(floor(),), sigma_t=(sigma_t,) * 3
        )
    )
    (light,) = reference.lights
    foot, height = foot_and_height(reference.origin, reference.direction, light.position)
    end = floor_distance(reference)
    theta1 = np.where(
        np.isfinite(end), np.arctan2(np.where(np.isfinite(end), end, 0) - foot, height), math.pi / 2
    )
    expected = (theta1 - np.arctan2(-foot, height)) / height
    factor = reference.medium.albedo * sigma_t * light.intensity / (4 * math.pi)
    # In each pixel the tolerance of the integrals; the medium itself is worth 1e-11.
    np.testing.assert_allclose(layers(reference)[0], expected[:, None] * factor, rtol=2e-10)
    assert np.all(airlight(mitsuba_dict(replace(fog_scene(), sigma_t=(0.0, 0.0, 0.0)))) == 0)


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("r", [0.25, 1.0, 3.0])
def test_fluence_of_first_order(variant, r):
    """Add up the airlight over all directions at a distance r from a source of unit power.

    phi = int albedo sigma_t exp(-sigma_t (r1 + r2)) / ((4 pi r1^2) r2^2 4 pi) dV, r1 and r2 the
    distances of dV from source and point. In prolate spheroidal coordinates, r1 + r2 = r xi and
    r1 - r2 = r eta, dV = r^3/8 (xi^2 - eta^2) dxi deta dphi and r1 r2 = r^2/4 (xi^2 - eta^2). The
    integral over eta is elementary, and with u = r xi

        phi = albedo sigma_t / (4 pi r) int_r^inf exp(-sigma_t u) log((u + r)/(u - r)) / u du.

    With psi the angle from the direction of the source, phi = 2 pi int L sin(psi) dpsi. L grows as
    1/psi towards the source; in psi = pi t^2 the integrand is smooth enough for 96 Gauss-Legendre
    nodes.
    """
    nodes, weights = np.polynomial.legendre.leggauss(96)
    t = 0.5 * (nodes + 1)
    psi = math.pi * t**2
    albedo, sigma_t = 0.75, 1.0
    light = FogLight((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    scene = replace(
        fog_scene(), lights=(light,), occluders=(), sigma_t=(sigma_t,) * 3, albedo=(albedo,) * 3
    )
    directions = np.stack([np.sin(psi), np.zeros_like(psi), np.cos(psi)], axis=1)
    around = replace(
        reference_of(scene),
        origin=np.array([0.0, 0.0, -r]),
        direction=directions,
        width=len(psi),
        height=1,
    )
    values = ray_values(around).airlight[:, 0] / (4 * math.pi)
    flux = 2 * math.pi * float(np.sum(values * np.sin(psi) * weights * math.pi * t))

    def integrand(v: float) -> float:  # u = r (1 + v^2) takes the logarithm off the end
        return (
            math.exp(-sigma_t * r * (1 + v * v))
            * math.log((2 + v * v) / (v * v))
            / (1 + v * v)
            * 2
            * v
        )

    integral = quad(integrand, 0, 1, epsrel=1e-12)[0] + quad(integrand, 1, np.inf, epsrel=1e-12)[0]
    # 96 directions: 48 give the same to 1e-6.
    assert flux == pytest.approx(albedo * sigma_t / (4 * math.pi * r) * integral, rel=1e-6)


@pytest.mark.claim("known-answers")
def test_a_floor_in_an_absorbing_medium(variant):
    """It is attenuated by exp(-sigma_t (camera to floor + floor to light)),
    and there is no airlight.
    """
    sigma_t = 0.75
    scene = replace(
        fog_scene(), lights=fog_scene().lights[:1], occluders=(floor(),), albedo=(0.0,) * 3
    )
    clear, dim = (
        reference_of(white(mitsuba_dict(replace(scene, sigma_t=(each,) * 3))))
        for each in (0.0, sigma_t)
    )
    end = floor_distance(clear)
    hit = np.isfinite(end)
    point = clear.origin + end[hit, None] * clear.direction[hit]
    path = end[hit] + np.linalg.norm(point - clear.lights[0].position, axis=1)
    (_, bright), (nothing, surface) = layers(clear), layers(dim)
    assert np.all(nothing == 0)
    # The floor is met at (corner - origin) . n / (direction . n) in float32. Dot products and
    # quotient round seven times, a distance d is off by that fraction of d, and the path from light
    # to camera by twice as much at most.
    allowed = 2 * sigma_t * end[hit, None] * 7 * 2.0**-24
    assert np.all(
        np.abs(surface[hit] / bright[hit] / np.exp(-sigma_t * path)[:, None] - 1) <= allowed
    )


@pytest.mark.claim("known-answers")
def test_a_box_of_fog_under_vertical_light(variant):
    """The segment from a height z goes straight up to the lid at z_1.

    A ray that is in the box from (height z_0) on for the length l, and rises by w_z a metre, has
    tau = sigma_t (z_1 - z_0 + (1 - w_z) y) after y metres, so

        L = albedo E p(w_z) / (4 pi) exp(-sigma_t (z_1 - z_0)) (1 - exp(-sigma_t (1 - w_z) l)) / (1 - w_z).
    """
    scene = {name: entry for name, entry in sun().items() if name != "slab"}
    scene["sun"] = scene["sun"] | {"to_world": {"matrix": np.diag([1.0, -1, -1, 1]).tolist()}}
    reference = reference_of(scene)
    (medium,), (light,) = reference.media, reference.directional
    with np.errstate(divide="ignore"):
        lower, upper = (
            (BOX[0] + sign * BOX[1] - reference.origin) / reference.direction for sign in (-1, 1)
        )
    low, high = np.minimum(lower, upper).max(axis=1), np.maximum(lower, upper).min(axis=1)
    length = np.maximum(high - low, 0.0)[:, None]
    rise = reference.direction[:, 2:]
    above = BOX[0][2] + BOX[1][2] - reference.origin[2] - low[:, None] * rise
    p = (1 - G**2) / (1 + G**2 - 2 * G * rise) ** 1.5
    integral = (
        np.exp(-medium.sigma_t * above)
        * -np.expm1(-medium.sigma_t * (1 - rise) * length)
        / (1 - rise)
    )
    expected = (
        medium.albedo * light.irradiance * p / (4 * math.pi) * np.where(length > 0, integral, 0.0)
    )
    assert difference(layers(reference)[0], expected) <= 1e-13  # float64 rounding


# --- Closed forms: area lights ---


@pytest.fixture(scope="module")
def lit(variant):
    """The rectangle of `panel` without occluders, and eight rays."""
    reference = reference_of(panel())
    return replace(
        reference,
        occluders=load_fog({"type": "scene"}),
        direction=reference.direction[4::8],
        width=8,
        height=1,
    )


def by_points(reference, light, count: int) -> np.ndarray:
    plan = PointPlan(error=0.0, first=count, most=count)
    return ray_values(replace(reference, area=(light,)), plan=plan).airlight


@pytest.mark.claim("known-answers")
def test_a_rectangle_shrinks_to_a_point(lit):
    """At equal power, and symmetric about its middle, it differs from a point
    by the square of its size.
    """
    (light,) = lit.area

    def sized(size: float) -> np.ndarray:
        return by_points(
            lit, replace(light, half=size * light.half, radiance=light.radiance / size**2), 256
        )

    first, second, point = (sized(size) for size in (2.0**-4, 2.0**-5, 2.0**-12))
    ratio = np.linalg.norm(first - point) / np.linalg.norm(second - point)
    # the next term of the series, and that of the points
    assert ratio == pytest.approx(4, rel=0.05)


TRIANGLE = np.array([[-0.25, -0.25], [0.5, 0.0], [0.125, 0.5]])
HALF_PLANE = np.array([[0.0, -64], [64, -64], [64, 64], [0, 64]])


def lid(corners: np.ndarray, height: float):
    """Return a Mitsuba scene of one convex polygon, as a fan of triangles."""
    mesh = mi.Mesh("lid", vertex_count=len(corners), face_count=len(corners) - 2)
    parameters = mi.traverse(mesh)
    vertices = np.concatenate([corners, np.full((len(corners), 1), height)], axis=1)
    parameters["vertex_positions"] = vertices.astype(np.float32).ravel()
    parameters["faces"] = np.array(
        [[0, k, k + 1] for k in range(1, len(corners) - 1)], dtype=np.uint32
    ).ravel()
    parameters.update()
    return mi.load_dict({"type": "scene", "lid": mesh})


@pytest.mark.claim("known-answers")
@pytest.mark.claim(
    "area-light-closed-forms", tolerance="8e-5 by 8 x 4096 samples: three standard errors"
)
@pytest.mark.parametrize(
    ("kind", "corners"),
    [("disk", HALF_PLANE), ("rectangle", TRIANGLE)],
    ids=["half plane", "triangle"],
)
def test_what_a_polygon_leaves_of_a_light(variant, kind, corners):
    """A light at the height 4 over points at 0, where a polygon at the height 2 is in the way.

    A half plane leaves 1 - (acos u - u sqrt(1 - u^2))/pi of a disk; a triangle leaves the
    clipped area of a rectangle.
    """
    reference = reference_of(panel(kind))
    half = np.array([0.625, 0.375]) if kind == "rectangle" else np.full(2, 0.5)
    middle = np.array([0.125, 0.25])
    light = replace(
        reference.area[0],
        centre=np.array([*middle, 4.0]),
        half=half,
        frame=np.diag([1.0, 1.0, -1.0]),
    )
    reference = replace(reference, area=(light,), occluders=lid(corners, 2.0))
    place = np.array(
        [
            [-0.375, 0.25, 0],
            [-0.1875, 0.125, 0],
            [0.0, 0.0625, 0],
            [0.125, 0.25, 0],
            [0.3125, 0.125, 0],
        ]
    )
    fraction = visible_fraction(reference, place, [0.0, 0.0, 1.0], 4096).mean(axis=1)
    # A corner at half the height is twice as far from the foot of the point where it
    # falls on the light's plane.
    fallen = [foot + 2 * (corners - foot) - middle for foot in place[:, :2]]
    if kind == "disk":
        expected = [1 - float(disk_fraction(shape[0, 0] / half[0])) for shape in fallen]
        assert expected[2] == pytest.approx(
            1 - polygon_in_disk(fallen[2] / half[0]) / math.pi, abs=1e-9
        )
    else:
        sides = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        expected = [1 - polygon_overlap(shape, sides) / (4 * half[0] * half[1]) for shape in fallen]
    # Three standard errors of 8 x 64 sections, 1.65e-3 measured over 24 seeds, at the least rate:
    # as N^-1 where an edge of the shadow is along the sections of one of the replicates, else as
    # N^-3/2.
    np.testing.assert_allclose(fraction, expected, atol=3 * 1.65e-3 * 64 / 4096, rtol=0)
