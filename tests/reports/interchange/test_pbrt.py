# SPDX-License-Identifier: BSD-3-Clause
"""A scene that is written for pbrt and read again has the same reference; what pbrt cannot render
is refused by name.
"""

import mitsuba as mi
import numpy as np
import pytest

import airlight
from airlight.errors import InputError
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.reports.interchange.pbrt import pbrt_scene
from airlight.reports.interchange.scene import describe_scene
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.scenes.names import scene_names
from tests.helpers.scenes import spot, tiny_scene

#: Scenes that pbrt cannot say: other phase functions than Henyey and Greenstein's, fog that varies; and
#: clouds of any shape, which have another reference.
REFUSED = {
    **dict.fromkeys(("two-pens", "three-media"), "phase function rayleigh, which pbrt lacks"),
    **dict.fromkeys(("street", "mist", "meadow", "valley", "smoke"), "differs from place to place"),
    **dict.fromkeys(("cumulus", "ring", "two-lobes"), "is not convex"),
    "stratocumulus": "has 129596 triangles",
    "cumulus-detail": "is heterogeneous",
}
WRITTEN = [name for name in scene_names() if name not in REFUSED]
QUICK = ("open-fog", "sphere-spot", "windows")


def references(name, folder):
    """Return the references of a built-in scene and of what is written of it."""
    loaded = load_scene(name, (16, 12))
    path = folder / f"{name}.pbrt"
    path.write_text(pbrt_scene(loaded))
    return [
        quadrature_image(read_reference(scene))
        for scene in (loaded.scene, load_scene(str(path), (16, 12)).scene)
    ]


def compare_references(name, folder):
    before, after = references(name, folder)
    # float32 rounds by 6e-8, and a ray that grazes a cone or a silhouette sees the square root of
    # that: 2.4e-4.
    grazing = 2.4e-4
    largest = np.abs(before.airlight - after.airlight).max()
    assert largest <= grazing * before.airlight.mean()
    # Surfaces are known to their error; under area lights they are means of random samples.
    known = before.surface_error + after.surface_error + grazing * before.surface.mean()
    if before.surface_se is not None:
        known = known + 5 * np.hypot(before.surface_se, after.surface_se)
    assert np.all(np.abs(before.surface - after.surface) <= known)


@pytest.mark.claim("pbrt-round-trip", tolerance="2.4e-4 of the mean, a grazing ray in float32")
@pytest.mark.parametrize("name", QUICK)
def test_a_scene_keeps_its_reference(variant, tmp_path, name):
    compare_references(name, tmp_path)


def test_describe_writes_a_scene_that_compare_takes_for_one(variant, tmp_path):
    path = tmp_path / "x.pbrt"
    described = airlight.describe("open-fog", size=(16, 12), output=path)
    assert described.pbrt == (str(path),)
    assert described.to_dict()["pbrt"] == [str(path)]
    assert f"{path}: the scene for pbrt-v4" in described.lines
    image = airlight.reference(path, size=(16, 12))
    assert airlight.compare(path, image).metrics.relative_rmse < 1e-6


@pytest.mark.claim("pbrt-round-trip", tolerance="2.4e-4 of the mean, a grazing ray in float32")
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in WRITTEN if name not in QUICK])
def test_every_scene_keeps_its_reference(variant, tmp_path, name):
    compare_references(name, tmp_path)


@pytest.mark.parametrize("name", ["two-pens", "mist"])
def test_what_pbrt_lacks_is_refused_by_name(variant, tmp_path, name):
    with pytest.raises(InputError, match=REFUSED[name]):
        airlight.describe(name, output=tmp_path / "x.pbrt")
    assert not list(tmp_path.iterdir())


@pytest.mark.claim("pbrt-round-trip")
@pytest.mark.slow
@pytest.mark.parametrize("name", [*REFUSED])
def test_every_other_scene_is_refused(variant, name):
    with pytest.raises(InputError, match=REFUSED[name]):
        pbrt_scene(load_scene(name))


def loaded(**changes):
    return LoadedScene("tiny", mi.load_dict(tiny_scene(**changes)), "A tiny scene.", "")


def test_a_spot_with_a_soft_edge_is_refused(variant):
    with pytest.raises(InputError, match=r"falls off linearly.*set its beam_width"):
        pbrt_scene(loaded(light=spot(cutoff=30.0, beam=20.0)))


def test_round_shapes_and_area_lights_are_the_same_numbers(variant, tmp_path):
    """Spheres and disks stay what they are, and lights shine on the same side."""
    turn = mi.ScalarTransform4f().look_at([0.3, 0.2, 2.1], [0.1, 0.4, 0.0], [0, 1, 0])
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": [3.0, 2.0, 1.0]}}
    grey = {"type": "twosided", "bsdf": {"type": "diffuse"}}
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    matrix = turn @ mi.ScalarTransform4f().scale(0.3)
    shapes = {
        "flipped": {
            "type": "disk",
            "to_world": matrix,
            "flip_normals": True,
            "emitter": emitter,
            "bsdf": {"type": "null"},
        },
        "bulb": {"type": "sphere", "center": [1.0, 0.2, 1.4], "radius": 0.2, "bsdf": black},
        "coin": {"type": "disk", "to_world": matrix, "bsdf": grey},
        "ball": {"type": "sphere", "center": [-0.4, 0.3, 0.2], "radius": 0.37, "bsdf": grey},
    }
    shapes["bulb"]["emitter"] = emitter
    first = loaded(**shapes)
    path = tmp_path / "x.pbrt"
    path.write_text(pbrt_scene(first))
    second = load_scene(str(path))
    one, other = (
        sorted(
            ({key: value for key, value in each.items() if key != "name"} for each in described),
            key=str,
        )
        for described in (
            [*scene["lights"], *scene["surfaces"]] for scene in map(describe_scene, (first, second))
        )
    )
    # The axes across a disk are free, pbrt's surfaces have two sides, and its rectangles are meshes.
    free = {"across", "up", "two_sided", "kind"}
    for a, b in zip(one, other, strict=True):
        assert a.keys() == b.keys()
        for key in a.keys() - free:
            if isinstance(a[key], (float, list)):
                np.testing.assert_allclose(a[key], b[key], atol=2e-6, rtol=2e-6)
            else:
                assert a[key] == b[key]
