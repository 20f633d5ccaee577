# SPDX-License-Identifier: BSD-3-Clause
from collections import Counter

import mitsuba as mi
import numpy as np
import pytest

from realtime.errors import InputError
from realtime.scene.mesh_adjacency import make_occluders, read_occluders
from tests.helpers.occluders import ALL, AWKWARD, SOUND, closed_sphere
from tests.helpers.scenes import tiny_scene


def occluders_of(*meshes):
    return make_occluders([(f"mesh {number}", *mesh) for number, mesh in enumerate(meshes)])


def half_edges(occluders):
    """By direction, how many triangles run along it; and the same as the entries say it."""
    triangles = occluders.triangles
    by_triangle = Counter(
        (int(t[k]), int(t[(k + 1) % 3]), number) for number, t in enumerate(triangles) for k in range(3)
    )
    by_entry: Counter = Counter()
    for (a, b), left, right, same in zip(occluders.edges.tolist(), occluders.left, occluders.right, occluders.same_way):
        by_entry[(a, b, int(left))] += 1
        if right != occluders.none:
            by_entry[(a, b, int(right)) if same else (b, a, int(right))] += 1
    return by_triangle, by_entry


@pytest.mark.parametrize("name", ALL)
def test_every_half_edge_is_in_one_entry(name):
    by_triangle, by_entry = half_edges(occluders_of(ALL[name]()))
    assert by_entry == by_triangle


@pytest.mark.parametrize("name", SOUND)
def test_sound_meshes_are_closed_and_in_silence(name):
    occluders = occluders_of(SOUND[name]())
    assert occluders.closed.all()
    assert occluders.warnings == ()
    assert not occluders.same_way.any()
    assert (occluders.right < occluders.none).all()
    assert len(occluders.edges) == 3 * len(occluders.triangles) // 2


@pytest.mark.claim("flawed-meshes-warn")
@pytest.mark.parametrize(
    ("name", "closed", "words"),
    [
        ("open grid", False, "is open"),
        ("open cylinder", False, "is open"),
        ("Moebius strip", False, "is open"),
        ("mixed winding", False, "run both ways round"),
        ("boxes sharing an edge", True, "1 edges at which more than two triangles meet"),
        ("doubled faces", True, "7 repeated triangles"),
        ("degenerate faces", True, None),
        ("sliver", True, None),
        ("inside out", True, None),
    ],
)
def test_flaws_are_named(name, closed, words):
    occluders = occluders_of(AWKWARD[name]())
    assert bool(occluders.closed.all()) is closed
    if words is None:
        assert occluders.warnings == ()
    else:
        assert any(words in warning and "'mesh 0'" in warning for warning in occluders.warnings)


def test_seams_are_closed_and_shapes_kept_apart():
    """Every triangle has vertices of its own, as where texture coordinates differ."""
    vertices, faces = closed_sphere(1)
    seams = (vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    occluders = occluders_of(seams, seams)
    assert occluders.closed.tolist() == [True, True]
    assert len(occluders.vertices) == 2 * len(vertices)
    assert np.all(occluders.triangles[: len(faces)] < len(vertices))
    assert np.all(occluders.triangles[len(faces) :] >= len(vertices))


@pytest.mark.claim("shapes-without-edges-refused")
def test_shapes_without_triangles_are_refused_by_name(variant):
    with pytest.raises(InputError, match=r"shape 'ball' is a sphere.*replace it by a mesh"):
        read_occluders(mi.load_dict(tiny_scene()))


def test_what_lets_light_pass_casts_no_shadow(variant):
    veil = {"type": "cube", "to_world": mi.ScalarTransform4f().scale(0.3), "bsdf": {"type": "null"}}
    occluders = read_occluders(mi.load_dict(tiny_scene(ball=None, veil=veil)))
    assert occluders.none == 2
