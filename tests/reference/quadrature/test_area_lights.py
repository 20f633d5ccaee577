# SPDX-License-Identifier: BSD-3-Clause
"""Airlight, surfaces and emission of area lights: against brute force,
and as certain as they say.
"""

from dataclasses import replace
from functools import partial

import mitsuba as mi
import numpy as np
import pytest
from scipy.special import roots_legendre

from airlight.reference.quadrature import area_lights
from airlight.reference.quadrature.area_lights import area_surface, beams_of
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.light_samples import samples_for_rays
from airlight.reference.quadrature.light_sections import sections_for_points
from airlight.reference.quadrature.replicates import (
    REPLICATES,
    PointPlan,
    square_points,
    standard_error,
)
from airlight.reference.quadrature.shared_samples import shared_samples
from airlight.reference.quadrature.surface import Reflection, surface_hits
from airlight.reference.scene.read import read_reference
from airlight.reference.visibility.certificate import segments_blocked
from airlight.reference.visibility.distances import exact_distance
from airlight.reference.visibility.lit_intervals import before_light
from airlight.validation.scenes.meshes import grid, icosphere, placed, scaled
from tests.evidence.closed_forms import sphere_airlight
from tests.helpers.area_lights import (
    GREY,
    NULL,
    airlight_replicates,
    ball,
    fixed,
    flat,
    fog,
    lamp,
    lit_room,
    lit_scene,
    mesh_lamp,
    ring,
    turned,
)

WHITE = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}
LAMPS = {"rectangle": flat, "disk": partial(flat, "disk"), "sphere": ball}
MESH = {"mesh": ring}


def room(light, **changes):
    return lit_room(light, **({"size": (5, 4)} | changes))


def empty(light, **changes):
    return room(light, empty=True, **changes)


@pytest.mark.parametrize("kind", LAMPS)
def test_samples_stand_for_the_area_and_the_solid_angle(variant, kind):
    """Rays that pass close, far, through the light and away from it; the mean of
    the places is the centre.
    """
    light = empty(LAMPS[kind]()).area[0]
    draw = np.random.default_rng(1).normal
    towards = np.concatenate([light.centre + 0.5 * draw(size=(60, 3)), draw(size=(60, 3))])
    direction = towards / np.linalg.norm(towards, axis=1)[:, None]
    square = square_points(fixed(2048), 0, 0, kind)
    samples = samples_for_rays(light, np.zeros(3), direction, np.full(120, np.inf), square)
    # the error of the points
    assert samples.weight.mean(axis=1) == pytest.approx(light.area, rel=5e-3)
    middle = np.mean(samples.weight[..., None] * samples.place, axis=1) / light.area
    assert middle == pytest.approx(np.broadcast_to(light.centre, middle.shape), abs=5e-3)
    place = 2 * draw(size=(60, 3))
    away = place - light.centre
    place = place[
        (away @ light.normal > 0.05) if kind != "sphere" else np.linalg.norm(away, axis=1) > 0.45
    ]
    angle = sections_for_points(light, place, square).weight.reshape(len(place), -1).mean(axis=1)
    way = place[:, None] - samples.place[0]
    r = np.linalg.norm(way, axis=2)
    cosine = np.maximum(np.sum(way * samples.normal[0], axis=2) / r, 0.0)
    expected = np.mean(cosine / r**2 * samples.weight[0], axis=1)
    assert angle == pytest.approx(expected, rel=2e-2)


def test_samples_of_a_mesh_stand_for_its_area(variant):
    """Their errors are those of random choices among triangles, by what these
    send: a ray has 2048 samples.
    """
    light = empty(ring()).area[0]
    assert light.shadows_itself
    towards = np.concatenate([light.centre + 0.5 * _draws(60, seed=1), _draws(60, seed=2)])
    direction = towards / np.linalg.norm(towards, axis=1)[:, None]
    square = square_points(fixed(2048), 0, 0, "mesh")
    samples = samples_for_rays(light, np.zeros(3), direction, np.full(120, np.inf), square)
    assert samples.weight.mean(axis=1) == pytest.approx(light.area, rel=4e-2)
    assert samples.weight.mean() == pytest.approx(light.area, rel=2e-3)


def _draws(count, seed):
    return np.random.default_rng(seed).normal(size=(count, 3))


def test_a_mesh_of_a_quad_is_the_rectangle_and_of_a_sphere_the_sphere(variant):
    """An icosphere of 1280 triangles emits in proportion to its area, 0.5 % below that
    of the sphere around it.
    """
    quad = grid((-0.5, -0.3, 0.0), (1.0, 0.0, 0.0), (0.0, 0.6, 0.0), (1, 1))
    turn = np.array(turned((0.0, 0.0, 0.0), 163, (1, 1, 1)).matrix, dtype=np.float64)[:3, :3]
    fine = placed(scaled(icosphere(3), 0.4), (0.3, 0.4, 2.9))
    for mesh, light in ((placed(quad, (0.3, 0.4, 2.9), turn), flat()), (fine, ball())):
        one, other = room(mesh_lamp(mesh)), room(light)
        images = [quadrature_image(reference, plan=fixed(64)) for reference in (one, other)]
        fraction = one.area[0].area / other.area[0].area
        for layer in ("airlight", "surface"):
            found, wanted = (getattr(image, layer) for image in images)
            error = np.hypot(*(getattr(image, f"{layer}_se") for image in images))
            assert np.sqrt(np.mean(error**2)) < 4e-2 * wanted.mean()
            assert np.all(np.abs(found - fraction * wanted) < 7 * error + 1e-3 * wanted + 1e-12)


def test_one_sample_by_plain_quadrature(variant):
    """The integral along the ray of cos_l V/r^2 exp(-sigma_t (x + r)), with the
    cosine as a dot product.
    """
    reference = empty(flat())
    light, square = reference.area[0], np.array([[0.3, 0.8]])
    nodes, weights = roots_legendre(2000)  # NumPy's takes ten seconds
    x, distance = 3.5 * (nodes + 1), np.full(len(reference.direction), 7.0)
    samples = samples_for_rays(light, reference.origin, reference.direction, distance, square)
    (beam,) = beams_of(reference, distance)
    every = np.tile(square, (REPLICATES, 1))  # the same sample in each replicate
    got = area_lights._scattered(beam, np.arange(len(distance)), every, 1.0)["radiance"][..., 0]
    for ray, direction in enumerate(reference.direction):
        away = reference.origin + x[:, None] * direction - samples.place[ray]
        r = np.linalg.norm(away, axis=1)
        f = (
            np.maximum(away @ light.normal / r, 0)
            / r**2
            * np.exp(-reference.medium.sigma_t[0] * (x + r))
        )
        factor = (
            reference.medium.albedo
            * reference.medium.sigma_t
            * light.radiance
            * samples.weight[ray]
            / (4 * np.pi)
        )
        assert got[ray] == pytest.approx(factor * 3.5 * (f @ weights), rel=1e-5)


def test_a_sphere_in_fog_is_exact_beside_its_edge(variant):
    """48 x 36 pixels around a sphere of radius 0.41 m, 5 m away, by the default plan,
    against its closed form.
    """
    sigma_t, radius, far = 0.21, 0.41, 5.0
    reference = lit_room(
        lamp("sphere", center=[0.0, 0.0, far], radius=radius), medium=fog(sigma_t, 1.0), empty=True
    )
    light = replace(reference.area[0], centre=np.array([0, 0, far]), radiance=np.ones(3))
    column, row = np.meshgrid((np.arange(48) - 23.5) / 24, (np.arange(36) - 17.5) / 24)
    direction = np.stack([0.5 * column.ravel(), 0.5 * row.ravel(), np.ones(48 * 36)], axis=1)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    height = far * np.hypot(direction[:, 0], direction[:, 1])
    direction = direction[height > radius]
    rays = replace(reference, area=(light,), origin=np.zeros(3), direction=direction)
    got = airlight_replicates(rays, PointPlan(), np.full(len(direction), 20.0))[:, 0].mean(axis=1)
    height, foot = far * np.hypot(direction[:, 0], direction[:, 1]), far * direction[:, 2]
    closed = [
        sphere_airlight(sigma_t, h, radius, foot=f, x0=0.0, x1=20.0)
        for h, f in zip(height, foot, strict=True)
    ]
    expected = np.array(closed) * sigma_t / (4 * np.pi)
    assert np.sqrt(np.mean((got - expected) ** 2)) < 5e-4 * expected.mean()
    assert np.max(np.abs(got / expected - 1)) < 5e-3


@pytest.mark.parametrize("kind", LAMPS)
def test_a_light_does_not_shadow_itself_and_black_is_null_for_what_it_sends(variant, kind):
    images = [
        quadrature_image(room(LAMPS[kind](bsdf=bsdf)), plan=fixed(4)) for bsdf in (None, NULL)
    ]
    clear = [image.distance == images[1].distance for image in images]
    same = clear[0]
    assert images[0].airlight[same] == pytest.approx(images[1].airlight[same], rel=1e-9)
    assert images[0].surface[same] == pytest.approx(images[1].surface[same], rel=1e-6, abs=1e-12)


HIGH, OVER, EDGE = 3.0, 1.1, 0.13


def beside_an_edge(light):
    """Return the floor under a light that half a plane covers, and what its points see.

    These are its scene, its hits and the places x and y of these.
    """
    up = mi.ScalarTransform4f()
    shapes = {
        "lamp": light,
        "floor": {"type": "rectangle", "to_world": up.scale(9.0), "bsdf": WHITE},
        "cover": {
            "type": "rectangle",
            "to_world": up.translate([0, EDGE - 50, OVER]).scale([60, 50, 1]),
            "bsdf": GREY,
        },
    }
    camera = up.look_at([0.3, 0.2, 0.9], [0.1, 0.15, 0.0], [0, 1, 0])
    reference = read_reference(
        lit_scene(size=(16, 12), to_world=camera, medium=fog(0.0, 0.5), **shapes)
    )
    hits = surface_hits(reference)
    hits = replace(hits, distance=exact_distance(reference, hits.interaction, hits.distance))
    x, y, _ = (reference.origin + hits.distance[:, None] * reference.direction).T
    return reference, hits, x, y


def check_surface(reference, hits, expected, plan, most):
    """Check the root mean square error of four seeds, relative to the mean."""
    beams, known = beams_of(reference, hits.distance), np.zeros((len(expected), 3))
    got = [
        area_surface(reference, hits, beams, known, plan=replace(plan, seed=seed))[:, 0]
        for seed in range(4)
    ]
    assert np.sqrt(np.mean((np.mean(got, axis=2) - expected) ** 2)) < most * expected.mean()


@pytest.mark.claim(
    "area-light-closed-forms", tolerance="the standard error of 1e-3 that is asked for"
)
def test_half_a_plane_before_a_rectangle(variant):
    """A white floor under a rectangle that half a plane covers, by the default plan and by 64
    sections, in closed form.

    The floor receives Le times the form factor of what is left, a rectangle (Howell, A catalog of
    radiation heat transfer configuration factors, B-4).
    """
    a, b = 0.7, 0.4
    over = mi.ScalarTransform4f().translate([0, 0, HIGH]).rotate([1, 0, 0], 180).scale([a, b, 1])
    reference, hits, x, y = beside_an_edge(lamp(radiance=(1, 1, 1), to_world=over))

    def from_foot(across, along):
        first, second = np.hypot(across, HIGH), np.hypot(along, HIGH)
        return 0.5 * (
            across / first * np.arctan(along / first) + along / second * np.arctan(across / second)
        )

    left = np.clip(y + (EDGE - y) * HIGH / OVER, -b, b)
    sides = [(1, a, b), (-1, -a, b), (-1, a, left), (1, -a, left)]
    expected = sum(sign * from_foot(end - x, side - y) for sign, end, side in sides) / np.pi
    assert 0.4 < np.mean((left > -b) & (left < b)) < 0.8
    # Root mean squares over 24 seeds: 8.5e-4, and 2.2e-4 of 64 sections; without
    # pairs 1.4e-3 and 1.3e-3.
    for plan, most in ((PointPlan(), 1e-3), (fixed(64), 3e-4)):
        check_surface(reference, hits, expected, plan, most)


@pytest.mark.claim(
    "area-light-closed-forms", tolerance="the standard error of 1e-3 that is asked for"
)
def test_half_a_plane_before_a_sphere(variant):
    """A white floor under a sphere that half a plane covers, by the default plan and by 64
    sections, in closed form.

    A floor with the normal n receives Le/2 times the integral of n . (w x dw) around what it sees
    (Lambert). A circle of half angle a about c, with u and v across, has w x dw = (sin(a)^2 c -
    cos(a) sin(a) (cos(phi) u + sin(phi) v)) dphi, and the plane of the edge gives its normal times
    the angle.
    """
    radius = 0.45
    reference, hits, x, y = beside_an_edge(
        lamp("sphere", radiance=(1, 1, 1), center=[0, 0, HIGH], radius=radius)
    )
    way = np.stack([-x, -y, np.full(len(x), HIGH)], axis=1)
    d = np.linalg.norm(way, axis=1, keepdims=True)
    c, sine = way / d, (radius / d)[:, 0]
    cosine = np.sqrt(1 - sine**2)
    # towards what is seen, across the edge
    m = np.stack([0 * x, np.full(len(x), OVER), y - EDGE], axis=1)
    m /= np.linalg.norm(m, axis=1, keepdims=True)
    along = np.sum(c * m, axis=1)
    across = np.sqrt(1 - along**2)
    u = (m - along[:, None] * c) / across[:, None]
    # the circle is seen from -phi to phi
    phi = np.arccos(np.clip(-along * cosine / (across * sine), -1, 1))
    chord = 2 * np.arccos(np.clip(cosine / across, -1, 1))
    seen = 2 * phi * sine**2 * c[:, 2] - 2 * np.sin(phi) * cosine * sine * u[:, 2]
    expected = 0.5 * (seen + np.where((phi > 0) & (phi < np.pi), chord * m[:, 2], 0.0)) / np.pi
    assert 0.4 < np.mean((phi > 0) & (phi < np.pi)) < 0.9
    for plan, most in ((PointPlan(), 1e-3), (fixed(64), 3e-4)):
        check_surface(reference, hits, expected, plan, most)


def test_what_is_within_a_sphere_hides_nothing(variant):
    within = {
        "type": "cube",
        "to_world": turned((0.3, 0.4, 2.7), 27, (0.1, 0.1, 0.1)),
        "bsdf": GREY,
    }
    scenes = [room(ball(), block=None, ball=None, **shapes) for shapes in ({}, {"within": within})]
    alone, filled = (quadrature_image(scene, plan=fixed(4)).surface for scene in scenes)
    assert alone.mean() > 0
    assert filled == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize(
    "kind",
    [
        "rectangle",
        "sphere",
        *(pytest.param(each, marks=pytest.mark.slow) for each in ("mesh", "disk")),
    ],
)
def test_surfaces_by_many_shadow_rays(variant, kind):
    """Samples in the solid angle against even points of the light, each seen or
    not along one float64 ray.
    """
    reference = room((LAMPS | MESH)[kind](), size=(8, 6))
    hits = surface_hits(reference)
    hits = replace(hits, distance=exact_distance(reference, hits.interaction, hits.distance))
    known = np.zeros((len(hits.distance), 3))
    lit = area_surface(reference, hits, beams_of(reference, hits.distance), known, plan=fixed(256))
    rows = np.flatnonzero(np.isfinite(hits.distance))
    point = reference.origin + hits.distance[rows, None] * reference.direction[rows]
    normal = np.array(hits.interaction.n, dtype=float).T[rows]
    normal *= -np.sign(np.sum(normal * reference.direction[rows], axis=1))[:, None]
    reflection = Reflection(hits.interaction)
    light, (_, shapes) = reference.area[0], before_light(reference, reference.area[0])
    count, replicates = 32, 8
    expected = np.zeros((len(rows), 3, replicates))
    for replicate in range(replicates):
        for sample in shared_samples(light, square_points(fixed(count), 3, replicate, kind)):
            way = sample.position - point
            r = np.linalg.norm(way, axis=1)
            way /= r[:, None]
            start = point + 1e-6 * normal
            end = np.broadcast_to(sample.position + 1e-6 * sample.axis, start.shape)
            seen = ~segments_blocked(start, end, shapes) & (np.sum(way * normal, axis=1) > 0)
            sent = np.maximum(-way @ sample.axis, 0) / r**2 * seen
            segment = np.exp(-np.outer(r + hits.distance[rows], reference.medium.sigma_t))
            expected[..., replicate] += (
                reflection(rows, way) * sent[:, None] * segment * sample.intensity / count
            )
    assert 0.1 < np.mean(lit[rows, 0].mean(axis=1) > 0) < 1
    difference = lit[rows].mean(axis=2) - expected.mean(axis=2)
    error = np.hypot(standard_error(lit[rows]), standard_error(expected))
    scale = expected.mean()
    # Student's value with seven degrees of freedom that one value in 100 000
    # exceeds; 1e-5: the rays' start.
    assert np.all(np.abs(difference) <= 9.1 * error + 1e-5 * scale)
    # Half of the even points of a mesh face away.
    assert np.sqrt(np.mean(error**2)) < (0.07 if kind == "mesh" else 0.02) * scale


def test_emission_is_seen_through_fog_and_not_from_behind(variant):
    light = lamp(to_world=turned((0.0, 0.0, 0.0), 0, (0.3, 0.3, 1.0)), bsdf=NULL)
    facing = read_reference(
        lit_scene(size=(9, 9), to_world=turned((0.0, 0.0, 2.0), 180, (1, 1, 1)), lamp=light)
    )
    behind = read_reference(
        lit_scene(size=(9, 9), to_world=turned((0.0, 0.0, -2.0), 0, (1, 1, 1)), lamp=light)
    )
    image = quadrature_image(facing, plan=fixed(2))
    assert image.emitted[4, 4] == pytest.approx(np.array([3, 2, 1]) * np.exp(-0.21 * 2), rel=1e-6)
    assert (image.emitted[0, 0] == 0).all()
    assert quadrature_image(behind, plan=fixed(2)).emitted.max() == 0


@pytest.mark.parametrize(("lifted", "stays"), [(0.0, False), (-0.1, False), (0.1, True)])
@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_a_plate_in_or_behind_the_plane_of_a_light_casts_no_shadow(variant, kind, lifted, stays):
    """Rounding would say by chance that one in the plane is before the light."""
    place = mi.ScalarTransform4f().translate([0.3, 0.4, 2.9]).rotate([0.8, 0.6, 0.0], 163)
    plate = {"type": kind, "to_world": place.translate([0, 0, lifted]), "bsdf": GREY}
    reference = read_reference(lit_scene(lamp=flat(bsdf=NULL), plate=plate))
    assert bool(before_light(reference, reference.area[0])[1].count) == stays


@pytest.mark.parametrize("bsdf", [NULL, None], ids=["null", "black"])
def test_a_plate_hides_a_lamp_right_behind_it(variant, bsdf):
    """A millimetre before a lamp 20 m away; a plate in the plane of the lamp touches it."""
    light = lamp(to_world=turned((0.0, 0.0, 20.0), 180, (2.0, 2.0, 1.0)), bsdf=bsdf)

    def seen(place):
        plate = {"type": "rectangle", "to_world": turned((0, 0, place), 180, (3, 3, 1))}
        scene = lit_scene(size=(1, 1), lamp=light, plate=plate | {"bsdf": GREY})
        return quadrature_image(read_reference(scene), plan=fixed(2)).emitted.max()

    assert seen(19.999) == 0
    assert seen(20.001) > 0
    if bsdf is NULL:  # else either of two opaque shapes in one plane may be met
        assert seen(20.0) > 0
