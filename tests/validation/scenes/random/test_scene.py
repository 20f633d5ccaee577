# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `random:SEED` is a scene wherever one is taken, valid, the same on
every run, sound and lit.
"""

import hashlib
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import qmc

from airlight.errors import InputError
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.scene_digest import scene_digest
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.meshes import grid
from airlight.validation.scenes.parts import mitsuba_mesh
from airlight.validation.scenes.random.design import COORDINATES, point, ranges_from
from airlight.validation.scenes.random.lights import Light
from airlight.validation.scenes.random.scene import draw_scene, drawn_values, with_reach


@pytest.mark.claim(
    "random-valid", tolerance="none: both readers take seeds 0 to 47, with all that was drawn"
)
@pytest.mark.parametrize(
    "seeds", [range(8), pytest.param(range(8, 48), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_both_readers_take_what_was_drawn(variant, seeds):
    for seed in seeds:
        loaded = load_scene(f"random:{seed}", (16, 12))
        drawn = drawn_values(loaded.name)
        ours, reference = read_scene(loaded.scene), read_reference(loaded.scene)
        assert len(ours.lights) + len(ours.area_lights) == len(drawn["lights"])
        assert len(reference.lights) + len(reference.area) + len(reference.directional) == len(
            drawn["lights"]
        )
        bounded = [medium for medium in drawn["media"] if medium["bounds"] != "unbounded"]
        assert len(reference.media) == len(bounded)
        assert ours.medium.clear == (len(bounded) == len(drawn["media"]))
        # The drawn values arrive in single precision, as the scene has it.
        sigma = {medium.name: medium.sigma_t for medium in reference.media} | {
            "unbounded": reference.medium.sigma_t
        }
        for medium in drawn["media"]:
            np.testing.assert_allclose(sigma[medium["name"]], medium["sigma_t"], rtol=1e-6)
        assert len(reference.occluders.shapes()) >= len(drawn["occluders"])


@pytest.mark.claim(
    "random-same",
    tolerance="none: the digests of two loads, and of the record kept here, are equal",
)
def test_the_same_seed_is_the_same_scene(variant):
    digests = [
        scene_digest(load_scene(name, (8, 6)).scene)
        for name in ("random:3", "random:3", "random:4")
    ]
    assert digests[0] == digests[1] != digests[2]
    # An old seed keeps its scene: the digest is of records, whose numbers no variant rounds.
    words = hashlib.sha256()
    for seed in range(8):
        drawn = drawn_values(f"random:{seed}")
        words.update(
            ",".join(
                f"{each['kind']} {each['position'][0]:.6g}" for each in drawn["lights"]
            ).encode()
        )
        words.update(
            ",".join(f"{each['kind']} {each['radius']:.6g}" for each in drawn["occluders"]).encode()
        )
    assert words.hexdigest()[:16] == KEPT


KEPT = "626df2435b5b8389"


def test_a_name_that_is_no_seed_is_refused():
    for name in (
        "random:",
        "random:seven",
        "random:-1",
        "random:7,meshes=.",
        "random:7,ranges=",
        "random:1:2",
    ):
        with pytest.raises(InputError, match=r"expected random:SEED|expected ranges=FILE"):
            load_scene(name)
    with pytest.raises(InputError, match="expected a whole number from 0"):
        load_scene("random:1000000001")


@pytest.mark.parametrize("seed", [1, 12_345])
def test_a_seed_is_a_point_of_the_sequence_without_those_before_it(seed):
    """`random:10000000` took 81 s, as all points before were drawn."""
    sequence = qmc.Halton(len(COORDINATES), scramble=True, rng=np.random.default_rng(2417))
    drawn = sequence.random(seed + 1)[-1]
    assert list(point(seed).values()) == drawn.tolist()


_POINTS = 512


@pytest.fixture(scope="module")
def points():
    return np.array([[point(seed)[name] for name in COORDINATES] for seed in range(_POINTS)])


@pytest.mark.claim(
    "random-cover",
    tolerance="a sixteenth of the range holds 0.4 to 1.6 times its fraction of 512 points",
)
def test_the_first_points_cover_every_coordinate(points):
    counts = np.array([np.histogram(column, bins=16, range=(0, 1))[0] for column in points.T])
    assert counts.min() > 0.4 * _POINTS / 16
    assert counts.max() < 1.6 * _POINTS / 16


@pytest.mark.claim("random-ranges", tolerance="none: what is drawn lies within the range")
def test_what_is_set_is_drawn():
    ranges = ranges_from(
        {
            "optical_depth": [0.5, 0.7],
            "lights": 2,
            "light_kinds": {"spot": 1},
            "media": {"unbounded": 1},
        }
    )
    for seed in range(12):
        drawn = draw_scene(seed, ranges)
        assert [light.kind for light in drawn.lights] == ["spot", "spot"]
        assert [medium.bounds for medium in drawn.media] == ["unbounded"]
        assert 0.5 <= drawn.media[0].optical_depth <= 0.7


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (
            {"optical_dept": [1, 2]},
            "got optical_dept, expected one of .*did you mean 'optical_depth'",
        ),
        ({"fov": [50, 20]}, r"fov: got \[50, 20\], expected \[from, to\]"),
        ({"fov": [50, 200]}, "fov: got 200, expected a number from 1 to 160"),
        # Two offsets of 1 and one of -1 made an extinction of mean (1 - 0.9 4/3), below 0.
        ({"colour_spread": 0.9}, "colour_spread: got 0.9, expected a number from 0 to 0.74"),
        ({"light_kinds": {"laser": 1}}, "got light_kinds.laser, expected one of point, spot"),
        ({"light_kinds": {"point": 0}}, "no weight is above 0"),
        ({"light_kinds": {"point": -1}}, "light_kinds.point: got -1, expected a number from 0 to"),
        ({"meshes": "/nowhere/at/all"}, "expected a folder of .obj and .ply files"),
    ],
)
def test_what_cannot_be_drawn_is_refused_by_name(table, words):
    with pytest.raises(InputError, match=words):
        ranges_from(table)


SEEDS = range(300)


@pytest.fixture(scope="module")
def scenes():
    return [draw_scene(seed, ranges_from({})) for seed in SEEDS]


def _clearance(occluder, place):
    return np.linalg.norm(np.subtract(occluder.position, place)) - occluder.radius


@pytest.mark.claim("random-clear", tolerance="none: the balls around occluders hold neither")
def test_no_occluder_holds_the_camera_or_a_light_unless_meant_to(scenes):
    for drawn in scenes:
        for occluder in drawn.occluders:
            if occluder.kind in ("floor", "wall", "room"):
                continue
            assert _clearance(occluder, drawn.origin) > 0, drawn.seed
            for light in drawn.lights:
                caged = occluder.kind == "cage" and np.all(occluder.position == light.position)
                assert caged or _clearance(occluder, light.position) > 0, (
                    drawn.seed,
                    occluder.name,
                    light.name,
                )


def test_all_lie_before_floor_wall_and_room(scenes):
    for drawn in scenes:
        near = [light.position for light in drawn.lights if light.kind != "directional"]
        for occluder in drawn.occluders:
            if occluder.kind in ("floor", "wall", "room"):
                vertices, faces = occluder.mesh
                a, b, c = (vertices[faces[:, corner]] for corner in range(3))
                for place in (drawn.origin, *near):
                    assert np.all(np.sum((place - a) * np.cross(b - a, c - a), axis=1) > 0), (
                        drawn.seed
                    )


@pytest.mark.claim(
    "random-not-round",
    tolerance="no number has fewer than four digits after the first in 300 scenes",
)
def test_no_number_is_round(scenes):
    for drawn in scenes:
        numbers = [drawn.scale, *drawn.centre, *drawn.origin, drawn.fov]
        for medium in drawn.media:
            numbers += [*medium.sigma_t, *medium.albedo]
        for light in drawn.lights:
            numbers += [*light.position, *light.colour]
        for number in numbers:
            assert number != float(f"{number:.4g}"), drawn.seed


def found(*meshes):
    """The lit part of a stage about the origin of radius 1 under a lamp, with occluders."""
    camera = {"origin": np.array([0.0, -4.0, 0.1]), "target": np.zeros(3), "fov": 47.0}
    lamp = Light("light-1", "point", np.array([0.0, 0.3, 5.0]), np.zeros(3), np.ones(3), 1.0)
    drawn = draw_scene(0, ranges_from({}))
    drawn = replace(drawn, centre=np.zeros(3), scale=1.0, lights=(lamp,), **camera)
    shapes = {
        f"occluder-{number}": mitsuba_mesh("occluder", mesh, (0.5,) * 3)
        for number, mesh in enumerate(meshes)
    }
    return with_reach(drawn, mi.load_dict({"type": "scene"} | shapes))


def test_what_light_reaches_is_measured(variant):
    without = found()
    assert (without.lit, without.near, without.enough) == (1.0, 0.0, True)
    under_a_plate = found(grid((-30.0, -30.0, 4.0), (60.0, 0, 0), (0, 60.0, 0), (1, 1)))
    assert (under_a_plate.lit, under_a_plate.enough) == (0.0, False)
    behind_a_wall = found(grid((-30.0, -3.0, -30.0), (60.0, 0, 0), (0, 0, 60.0), (1, 1)))
    assert behind_a_wall.near == 1.0
