# SPDX-License-Identifier: BSD-3-Clause
from collections import Counter

import numpy as np
import pytest

from realtime.errors import InputError
from realtime.scene.mesh_adjacency import make_casters, moved, read_casters
from tests.helpers.casters import ALL, AWKWARD, SOUND, boxes_sharing_an_edge, closed_box, closed_sphere, open_grid
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


@pytest.mark.parametrize("name", ALL)
def test_opposite_half_edges_are_paired_first(name):
    """So that of an edge as few entries as possible are a border or run the same way."""
    casters = casters_of(ALL[name]())
    lonely: Counter = Counter()
    for t in casters.triangles.tolist():
        for k in range(3):
            a, b = t[k], t[(k + 1) % 3]
            lonely[min(a, b), max(a, b)] += 1 if a < b else -1
    unpaired: Counter = Counter()
    for (a, b), right, same in zip(casters.edges.tolist(), casters.right, casters.same_way):
        unpaired[min(a, b), max(a, b)] += 1 if right == casters.none else 2 if same else 0
    assert unpaired == {edge: abs(rest) for edge, rest in lonely.items()}


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


def test_border_of_a_sheet_has_one_triangle_an_edge():
    casters = casters_of(open_grid())
    assert int(np.sum(casters.right == casters.none)) == 18


def test_edge_of_four_triangles_is_two_entries():
    casters = casters_of(boxes_sharing_an_edge())
    entries = Counter(map(tuple, np.sort(casters.edges, axis=1).tolist()))
    assert sorted(entries.values())[-2:] == [1, 2]
    assert len(casters.closed) == 1


def test_components_are_connected():
    casters = casters_of(SOUND["nested spheres"](), closed_box(), open_grid())
    assert np.bincount(casters.component).tolist() == [320, 320, 12, 40]
    assert casters.closed.tolist() == [True, True, True, False]
    for component, (low, high) in enumerate(casters.boxes):
        corners = casters.vertices[casters.triangles[casters.component == component]]
        assert np.array_equal(low, corners.min(axis=(0, 1)))
        assert np.array_equal(high, corners.max(axis=(0, 1)))


def test_seams_are_closed_and_shapes_kept_apart():
    """Every triangle has vertices of its own, as where texture coordinates differ."""
    vertices, faces = closed_sphere(1)
    seams = (vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    casters = casters_of(seams, seams)
    assert casters.closed.tolist() == [True, True]
    assert len(casters.vertices) == 2 * len(vertices)
    assert np.all(casters.triangles[: len(faces)] < len(vertices))
    assert np.all(casters.triangles[len(faces) :] >= len(vertices))


@pytest.mark.parametrize("name", ["torus", "open cylinder", "mixed winding"])
def test_moved_casters_are_those_of_moved_meshes(name):
    vertices, faces = ALL[name]()
    turn = np.array([[0.36, -0.48, 0.8], [0.8, 0.6, 0.0], [-0.48, 0.64, 0.6]])
    casters = casters_of((vertices, faces))
    there = moved(casters, casters.vertices @ turn.T + (3.1, -0.7, 0.2))
    corners = there.vertices[there.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert there.normals == pytest.approx(normal)
    assert there.offsets == pytest.approx(np.sum(normal * corners[:, 2], axis=1))
    assert there.boxes[:, 0].min(axis=0) == pytest.approx(there.vertices.min(axis=0))
    assert there.edges is casters.edges


def test_no_meshes_are_no_casters():
    casters = make_casters([])
    assert (casters.none, len(casters.edges), len(casters.closed), casters.warnings) == (0, 0, 0, ())


def test_triangles_of_mitsuba_shapes(variant):
    """A cube has 24 vertices, three at every corner; a rectangle two triangles."""
    import mitsuba as mi

    cube = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0.1, 0.2, 0.7]).scale([0.3, 0.4, 0.5])}
    casters = read_casters(mi.load_dict(tiny_scene(ball=None, cube=cube)))
    assert sorted(np.bincount(casters.component).tolist()) == [2, 12]
    assert len(casters.vertices) == 8 + 4
    box = casters.boxes[int(np.argmax(casters.closed))]
    assert box == pytest.approx(np.array([[-0.2, -0.2, 0.2], [0.4, 0.6, 1.2]]), abs=1e-6)


@pytest.mark.claim("shapes-without-edges-refused")
def test_shapes_without_triangles_are_refused_by_name(variant):
    import mitsuba as mi

    with pytest.raises(InputError, match=r"shape 'ball' is a Sphere.*replace it by a mesh"):
        read_casters(mi.load_dict(tiny_scene()))


def test_what_lets_light_pass_casts_no_shadow(variant):
    import mitsuba as mi

    veil = {"type": "cube", "to_world": mi.ScalarTransform4f().scale(0.3), "bsdf": {"type": "null"}}
    casters = read_casters(mi.load_dict(tiny_scene(ball=None, veil=veil)))
    assert casters.none == 2
