# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what one side cannot render is refused by name, in one line, and by the other side too."""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.meshes import box, prism, star
from airlight.validation.scenes.numbers import check_numbers
from airlight.validation.scenes.parts import medium_boundary, point_light
from tests.helpers.lamps import area_lamp
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene
from tests.helpers.suns import sun

FOG = {"type": "homogeneous", "sigma_t": 0.2, "albedo": 0.5}
CUBE, SPHERE, CLEAR = {"type": "cube"}, {"type": "sphere"}, {"bsdf": {"type": "null"}}
BOX = box((1.0, 1.1, 1.2))


def holding(shape, **changes: Any) -> dict[str, Any]:
    """Return a camera in vacuum before a shape that is filled with fog."""
    return clear_scene(puff=bounded_medium(shape, 0.3, (0.7, 0.7, 0.7)) | changes)


def mesh(vertices, faces) -> dict[str, Any]:
    return clear_scene(
        puff=medium_boundary("puff", (np.asarray(vertices, dtype=float), np.asarray(faces)), FOG)
    )


def ball(**entries: Any) -> dict[str, Any]:
    return tiny_scene(ball={"type": "sphere"} | entries)


def lit(kind: str, **changes: Any) -> dict[str, Any]:
    return tiny_scene(lamp=area_lamp(kind, **changes))


def radiance(value) -> dict[str, Any]:
    return {"emitter": {"type": "area", "radiance": value}}


def texture() -> dict[str, Any]:
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ones((2, 2, 3), dtype=np.float32)),
        "raw": True,
    }


def scaled(part: dict[str, Any], *scale: float) -> dict[str, Any]:
    """Return a shape or a light whose object is scaled along its axes."""
    turned = part.get("to_world", mi.ScalarTransform4f())
    return part | {"to_world": turned @ mi.ScalarTransform4f().scale(list(scale))}


def beside(light: dict[str, Any]) -> dict[str, Any]:
    """Return a ball of fog in vacuum beside a light."""
    return clear_scene(lamp=light, puff=bounded_medium(SPHERE, 0.3, (0.7, 0.7, 0.7)))


def beam(scale: float) -> dict[str, Any]:
    turned = mi.ScalarTransform4f().look_at([0, 0, 4], [1, 1, 0], [0, 1, 0])
    return scaled({"type": "directional", "to_world": turned}, 1, 1, scale)


def sheared():
    return mi.ScalarTransform4f(
        np.array([[1, 0.3, 0, 0.5], [0, 1, 0, 0.7], [0, 0, 1, 1.9], [0, 0, 0, 1]])
    )


def around_the_camera() -> dict[str, Any]:
    return CUBE | {"to_world": mi.ScalarTransform4f().translate([0, -4.0, 1.0])}


def in_fog() -> dict[str, Any]:
    return bounded_medium(CUBE, 0.3, (0.7, 0.7, 0.7)) | {"exterior": {"type": "ref", "id": "fog"}}


def without_medium() -> dict[str, Any]:
    return {
        "sensor": {
            name: value for name, value in tiny_scene()["sensor"].items() if name != "medium"
        }
    }


def fog(**entries: Any) -> dict[str, Any]:
    return tiny_scene(fog=tiny_scene()["fog"] | entries)


#: Scenes that both sides refuse, and words of both messages.
BOTH = [
    (lambda: tiny_scene(lamp=None), "no light; expected"),
    (lambda: tiny_scene(lamp=None, sky={"type": "constant"}), "light 'sky'"),
    (lambda: tiny_scene(lamp=None, sun=sun()), "directional.*medium without bounds"),
    (lambda: tiny_scene(lamp=None, sun=sun(), puff=in_fog()), "directional.*medium without bounds"),
    (
        lambda: ball(bsdf={"type": "mask", "nested": {"type": "diffuse"}}),
        "'ball' is partly transparent",
    ),
    (lambda: ball(interior=FOG), "'ball' bounds a medium and has a SmoothDiffuse material"),
    (
        lambda: ball(bsdf={"type": "dielectric"}, interior=FOG),
        "'ball' bounds a medium and has a SmoothDielectric",
    ),
    (lambda: tiny_scene(**without_medium()), "the camera references no medium"),
    (lambda: tiny_scene(sensor={"type": "thinlens", "aperture_radius": 0.1}), "ThinLens"),
    (lambda: tiny_scene(sensor={"type": "orthographic"}), "Orthographic"),
    (clear_scene, "the camera references no medium"),
    (lambda: holding(around_the_camera()), "the camera is inside of shape 'puff'"),
    (lambda: holding(CUBE, exterior=FOG), "exterior medium of shape 'puff'"),
    (lambda: clear_scene(puff=CUBE | CLEAR | {"exterior": FOG}), "'puff' is a hole in a medium"),
    (lambda: holding({"type": "cylinder"}), "'puff' bounds a medium and is a cylinder"),
    (lambda: holding({"type": "disk"}), "'puff' bounds a medium and is a disk"),
    (
        lambda: holding({"type": "sphere", "flip_normals": True}),
        "'puff' bounds a medium and is inside out.*remove flip",
    ),
    (
        lambda: holding(scaled(SPHERE, -1, 1, 1)),
        "'puff' bounds a medium and is inside out.*negative scale",
    ),
    (lambda: tiny_scene(lamp=scaled(spot(), 2, 1, 1)), "light 'lamp' .*stretches its cone"),
    (lambda: tiny_scene(lamp=scaled(spot(), 1, 1, 0.2)), "light 'lamp' .*stretches its cone"),
    (
        lambda: tiny_scene(lamp=spot() | {"to_world": sheared()}),
        "light 'lamp' .*stretches its cone",
    ),
    (
        lambda: beside(beam(3.0)),
        "light 'lamp' .*scales its direction by 3",
    ),
    (lambda: mesh(BOX[0], BOX[1][:, ::-1]), "'puff' bounds a medium and is inside out"),
    (lambda: mesh(BOX[0], BOX[1][1:]), "'puff' bounds a medium and is not a closed surface"),
    (lambda: lit("cylinder"), "light 'lamp'.* is a cylinder"),
    (
        lambda: lit("rectangle") | {"lamp": area_lamp("rectangle", to_world=sheared())},
        "light 'lamp'.* is sheared",
    ),
    (lambda: lit("disk", size=(0.3, 0.2)), "light 'lamp'.*one scale"),
    (lambda: lit("rectangle", size=(0.0, 0.3)), "light 'lamp'.* has no area"),
    (lambda: lit("sphere", size=0.3, flip_normals=True), "light 'lamp'.*remove flip_normals"),
    (
        lambda: tiny_scene(lamp=scaled(area_lamp("sphere", size=0.3), 1, 1, -1)),
        "light 'lamp'.*negative scale",
    ),
    (lambda: lit("sphere", size=9.0), "light 'lamp'.* camera"),
    (
        lambda: lit("sphere", size=0.3, material={"type": "null"}, interior=FOG),
        "light 'lamp'.* bounds a medium",
    ),
    (lambda: lit("rectangle", **radiance(texture())), "light 'lamp'.* textur"),
    (lambda: tiny_scene(lamp=spot() | {"texture": texture()}), "light 'lamp' .*has a texture"),
]
#: Numbers that are refused before either side reads a scene, and by both sides.
NUMBERS = [
    (lambda: fog(sigma_t=-1.0), "sigma_t"),
    (lambda: fog(sigma_t=float("nan")), "sigma_t"),
    (lambda: fog(albedo=1.5), "albedo"),
    (
        lambda: tiny_scene(spot=spot(cutoff=95.0, beam=90.0)),
        "cutoff_angle .* 95 degrees; expected more than 0",
    ),
    (lambda: tiny_scene(lamp=point_light((0.7, 0.3, 1.9), (-1.0, 2.0, 2.0))), "intensity"),
    (
        lambda: lit("disk", size=0.3, **radiance({"type": "rgb", "value": [-1.0, 0.0, 0.0]})),
        "light '.*radiance",
    ),
]
#: Scenes that only the methods refuse.
METHODS = [
    (lambda: ball(**CLEAR), "'ball' is transparent and bounds no medium"),
    (lambda: mesh(BOX[0] * (1, 1, 0), BOX[1]), "has no volume|not a closed"),
]
REFERENCE = [
    (lambda: mesh(*prism(star(0.4, 1.0, 5), 1.0)), "'puff' bounds a medium and is not convex")
]


@pytest.mark.claim(
    "scenes-refused-by-name", "media-refused", "directional-wants-bounds", tolerance="by name"
)
@pytest.mark.parametrize(
    ("make", "words", "readers"),
    [
        *((*case, (read_scene, read_reference)) for case in BOTH),
        *((*case, (read_scene, read_reference, check_numbers)) for case in NUMBERS),
        *((*case, (read_scene,)) for case in METHODS),
        *((*case, (read_reference,)) for case in REFERENCE),
    ],
)
def test_what_cannot_be_rendered_is_refused_by_name(variant, make, words, readers):
    scene = mi.load_dict(make())
    for reader in readers:
        with pytest.raises(InputError, match=words) as refusal:
            reader(scene)
        assert "\n" not in str(refusal.value)
