# SPDX-License-Identifier: BSD-3-Clause
"""Claim: grids of densities and closed meshes of clouds are read as they are; what is
none is refused in one line.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.memory import Memory
from airlight.realtime.methods.registry import FOG_METHODS, METHODS
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.scene.closed_mesh import closed_mesh, encloses
from airlight.realtime.scene.density import DensityGrid, density_at, density_on_device, read_density
from airlight.realtime.scene.read_scene import describe, read_scene
from airlight.validation.scenes.meshes import box, joined, placed, torus
from tests.helpers.clouds import (
    DROPLETS,
    SUN,
    TURN,
    cloud,
    cloud_of,
    cloud_scene,
    dense,
    linear_between,
    loaded,
    ring,
)

pytestmark = pytest.mark.usefixtures("variant")

LOW, HIGH = np.array([-131.7, -117.3, -141.9]), np.array([139.1, 121.7, 143.3])
RANDOM = np.random.default_rng(7)
ROUGH = RANDOM.random((5, 7, 6)) ** 2


def grid_scene(medium=None, **changes):
    medium = medium or dense(ROUGH, LOW, HIGH, **changes)
    return mi.load_dict(cloud_scene(sun=SUN, ring=cloud("ring", ring(), medium)))


@pytest.mark.parametrize("precision", ["single", "double"])
def test_a_grid_is_linear_between_its_voxels(precision):
    """On the device, in the reader's check and in Mitsuba alike; beyond the
    outermost voxels it is constant.
    """
    scene = grid_scene()
    density = read_scene(scene, precision).medium.clouds.density
    points = np.concatenate(
        [RANDOM.uniform(LOW, HIGH, (400, 3)), [LOW, HIGH, LOW + (HIGH - LOW) * 0.01]]
    )
    vector = type(read_scene(scene, precision).camera.origin)
    found = np.array(density.at(vector(points.T), mi.UInt32(0)))
    expected = linear_between(ROUGH, LOW, HIGH, points) / ROUGH.max()
    np.testing.assert_allclose(found, expected, atol=2e-5 if precision == "single" else 5e-6)
    values = (ROUGH / ROUGH.max()).astype(np.float32)
    np.testing.assert_allclose(
        density_at(values, (points - LOW) / (HIGH - LOW)), expected, atol=1e-6
    )


def test_a_turned_grid_far_away():
    """The transform is measured: right to a fraction of the grid, wherever that is."""
    middle = np.array([71_903.0, -51_307.0, 31_711.0])
    turn = (
        mi.ScalarTransform4f()
        .translate(middle.tolist())
        .rotate([2 / 7, 6 / 7, -3 / 7], 37.0)
        .scale([307.0, 331.0, 293.0])
    )
    to_world = turn @ mi.ScalarTransform4f().translate([-0.5, -0.5, -0.5])
    medium = dense(ROUGH, LOW, HIGH)
    medium["sigma_t"] |= {"to_world": to_world}
    vertices, faces = ring()
    shape = cloud("ring", (vertices + middle, faces), medium)
    scene = mi.load_dict(
        cloud_scene(sun=SUN, ring=shape, origin=tuple(middle + np.array([30.8, -400.9, 57.0])))
    )
    density = read_scene(scene, "double").medium.clouds.density
    fraction = RANDOM.random((300, 3))
    matrix = np.array(to_world.matrix, dtype=np.float64).reshape(4, 4)
    points = fraction @ matrix[:3, :3].T + matrix[:3, 3]
    found = np.array(density.at(mi.Vector3d(points.T), mi.UInt32(0)))
    # Mitsuba's box in float32 is right to 0.004 m of 50 m wide voxels here.
    np.testing.assert_allclose(
        found, linear_between(ROUGH, np.zeros(3), np.ones(3), fraction) / ROUGH.max(), atol=5e-4
    )


def test_the_transform_of_a_turned_grid_is_measured_and_its_grid_left_as_it_was():
    """Six digits of a word were right to 2.6e-6 of this grid."""
    turn = mi.ScalarTransform4f().rotate([2 / 7, 6 / 7, -3 / 7], 37.0).scale([2.07, 0.471, -1.93])
    to_world = turn @ mi.ScalarTransform4f().translate([-0.5, -0.5, -0.5])
    loose = dense(ROUGH, LOW, HIGH)
    medium = mi.load_dict(loose | {"sigma_t": loose["sigma_t"] | {"to_world": to_world}})

    def contents():
        majorant = medium.get_majorant(dr.zeros(mi.MediumInteraction3f))
        return [*np.array(mi.traverse(medium)["sigma_t.data"]).ravel(), *np.array(majorant).ravel()]

    before = contents()
    grid = read_density(medium, "the grid")
    corners = np.indices((2, 2, 2)).reshape(3, -1)
    matrix = np.array(to_world.matrix, dtype=np.float64).reshape(4, 4)
    places = matrix[:3, :3] @ corners + matrix[:3, 3:]
    np.testing.assert_allclose(
        grid.to_grid[:, :3] @ places + grid.to_grid[:, 3:], corners, atol=1e-6
    )
    assert contents() == before


@pytest.mark.parametrize(
    ("side", "words"), [(1024, "1073741824 voxels in all; expected fewer"), (300, "GB of memory")]
)
def test_grids_that_nothing_can_hold_are_refused_before_they_are_copied(monkeypatch, side, words):
    monkeypatch.setattr(
        "airlight.realtime.memory.usable_memory", lambda: Memory(10**9, "this machine has")
    )
    voxel = np.broadcast_to(np.float32(1), (side, side, side))  # one number in memory
    grid = DensityGrid(voxel, 1.0, np.eye(3, 4))
    with pytest.raises(InputError, match=words):
        density_on_device([grid], array_types("single"))


NEGATIVE = ROUGH.copy()
NEGATIVE[2, 3, 1] = -0.1


@pytest.mark.claim("hypertexture-refused", tolerance="none: an error and its words")
@pytest.mark.parametrize(
    ("medium", "words"),
    [
        (lambda: dense(NEGATIVE, LOW, HIGH), r"has -0.1 in voxel \(1, 3, 2\), and 1 such"),
        (lambda: dense(0 * ROUGH, LOW, HIGH), "is empty: its grid is 0 everywhere"),
        (lambda: dense(ROUGH, LOW, HIGH * (1, 1, 0.1)), (
            r"does not cover the shape: vertex \d+ at \("
        )),
        (lambda: dense(ROUGH, LOW, HIGH) | {"sigma_t": 0.1}, "is no grid"),
        (
            lambda: dense(ROUGH, LOW, HIGH, albedo={"type": "gridvolume", (
                "grid"
            ): mi.VolumeGrid(ROUGH[..., None])}),
            "an albedo that differs from place to place",
        ),
        (
            lambda: (medium := dense(ROUGH, LOW, HIGH)) | {"sigma_t": medium["sigma_t"] | {"filter_type": (
                "nearest"
            )}},
            "filter_type 'trilinear'",
        ),
    ],
)  # fmt: skip
def test_what_is_no_density_is_refused_by_name(medium, words):
    with pytest.raises(InputError, match=words) as refusal:
        read_scene(grid_scene(medium()))
    assert "of shape 'ring'" in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.claim("hypertexture-refused", tolerance="none: an error and its words")
@pytest.mark.parametrize("name", FOG_METHODS)
def test_methods_for_fog_refuse_a_density_and_name_those_for_clouds(name):
    convex = placed(box((50.0, 60.0, 70.0)), (3.0, 1.0, 2.0))
    read = read_scene(
        mi.load_dict(cloud_scene(sun=SUN, box=cloud("box", convex, dense(ROUGH, LOW, HIGH))))
    )
    kernel = {"kernel": KERNELS["exact"]} if METHODS[name]().uses_kernel else {}
    with pytest.raises(
        InputError, match=r"heterogeneous medium.*cloud-collectors or cloud-octaves"
    ) as refusal:
        frame_renderer(read, METHODS[name], **kernel)
    assert "\n" not in str(refusal.value)


# Closed meshes around clouds: what lies inside, and where a camera may be -------------------------


def flipped(mesh):
    return mesh[0], mesh[1][:, ::-1]


# in the middle of the tube of the ring
WITHIN = np.array([3.71, -0.13, 2.03]) + 101.37 * TURN[:, 0]


def test_a_hollow_cloud_and_a_cloud_in_its_hollow_are_taken():
    shell = joined(
        [
            placed(torus(101.0, 41.0, (23, 17)), (0, 0, 0)),
            placed(flipped(torus(101.0, 17.0, (23, 17))), (0, 0, 0)),
        ]
    )
    core = placed(torus(101.0, 5.0, (23, 17)), (0, 0, 0))
    read = read_scene(loaded(sun=SUN, shell=cloud("shell", shell), core=cloud("core", core)))
    assert describe(read)["medium"] == "2 clouds in vacuum, bounded by meshes: rays cast at them"
    mesh = closed_mesh("shell", *shell)
    assert [encloses(mesh, np.array([x, 0.3, 0.1])) for x in (101.0, 125.0, 150.0, 0.0)] == [
        False,
        True,
        False,
        False,
    ]


def test_a_camera_in_a_cloud_references_it():
    with pytest.raises(InputError, match="the camera is inside of shape 'ring'"):
        read_scene(mi.load_dict(cloud_scene(origin=tuple(WITHIN))))
    medium = mi.load_dict(DROPLETS)
    scene = cloud_scene(origin=tuple(WITHIN), sun=SUN, ring=cloud_of("ring", ring(), medium))
    scene["sensor"]["medium"] = medium
    assert not read_scene(mi.load_dict(scene)).medium.bounded_media
