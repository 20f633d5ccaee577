# SPDX-License-Identifier: BSD-3-Clause
from collections import Counter

import mitsuba as mi
import numpy as np
import pytest

from realtime.errors import InputError
from realtime.scene.mesh_adjacency import make_casters, read_casters
from tests.helpers.casters import ALL, AWKWARD, SOUND, closed_sphere
from tests.helpers.scenes import tiny_scene


def casters_of(*meshes):
    return make_casters([(f"mesh {number}", *mesh) for number, mesh in enumerate(meshes)])


def half_edges(casters):
    """By direction, how many triangles run along it; and the same as the entries say it."""
    triangles = casters.triangles
    by_triangle = Counter(
        (int(t[k]), int(t[(k + 1) % 3]), number) for number, t in enumerate(triangles) for k in range(3)
    )
    by_entry: Counter = Counter()
    for (a, b), left, right, same in zip(casters.edges.tolist(), casters.left, casters.right, casters.same_way):
        by_entry[(a, b, int(left))] += 1
        if right != casters.none:
            by_entry[(a, b, int(right)) if same else (b, a, int(right))] += 1
    return by_triangle, by_entry


@pytest.mark.parametrize("name", ALL)
def test_every_half_edge_is_in_one_entry(name):
    by_triangle, by_entry = half_edges(casters_of(ALL[name]()))
    assert by_entry == by_triangle


@pytest.mark.parametrize("name", SOUND)
def test_sound_meshes_are_closed_and_in_silence(name):
    casters = casters_of(SOUND[name]())
    assert casters.closed.all()
    assert casters.warnings == ()
    assert not casters.same_way.any()
    assert (casters.right < casters.none).all()
    assert len(casters.edges) == 3 * len(casters.triangles) // 2


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
    casters = casters_of(AWKWARD[name]())
    assert bool(casters.closed.all()) is closed
    if words is None:
        assert casters.warnings == ()
    else:
        assert any(words in warning and "'mesh 0'" in warning for warning in casters.warnings)


def test_seams_are_closed_and_shapes_kept_apart():
    """Every triangle has vertices of its own, as where texture coordinates differ."""
    vertices, faces = closed_sphere(1)
    seams = (vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    casters = casters_of(seams, seams)
    assert casters.closed.tolist() == [True, True]
    assert len(casters.vertices) == 2 * len(vertices)
    assert np.all(casters.triangles[: len(faces)] < len(vertices))
    assert np.all(casters.triangles[len(faces) :] >= len(vertices))


@pytest.mark.claim("shapes-without-edges-refused")
def test_shapes_without_triangles_are_refused_by_name(variant):
    with pytest.raises(InputError, match=r"shape 'ball' is a sphere.*replace it by a mesh"):
        read_casters(mi.load_dict(tiny_scene()))


def test_what_lets_light_pass_casts_no_shadow(variant):
    veil = {"type": "cube", "to_world": mi.ScalarTransform4f().scale(0.3), "bsdf": {"type": "null"}}
    casters = read_casters(mi.load_dict(tiny_scene(ball=None, veil=veil)))
    assert casters.none == 2
