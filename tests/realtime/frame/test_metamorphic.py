# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what changes nothing of the light changes nothing of an image, for every method
and every built-in scene.

Six relations need no reference, and meet faults that no reference was asked about:

- all intensities times 2 double the image;
- lengths times 2 with the extinction halved and intensities times 4 change nothing;
- a speck far behind the camera changes nothing;
- the world moved and turned with its camera changes nothing;
- two lights are the sum of each;
- the bounds of a medium moved where no ray comes change nothing.

Rules say what rounding and a method's discretisation allow:

- *Powers of two* are exact in floating point: twice the light is twice the image to the last bit.
  Twice the lengths are so to the last bits: grids, bounds and layers know places to a rounding of a
  metre.
- *A speck* is behind the camera, and all numbers in view are the same. The map of a sun's shadows
  spans the speck, too: its texels lie elsewhere, and heights in it are rounded.
- *Moved*, coordinates are rounded: those of 32 m to 2e-6 m. A ray that passes a light at 2 cm has
  its airlight to 1e-4. Of 192 rays 2 % may graze an edge, and meet the other side of it.
- *Maps of shadows* have texels along the axes of the world, or about an axis that follows from
  them. A turn by a right angle at least moves faces onto faces. The rest is as large as the error
  of the texels, which the difference to a map with four times as many on a side measures; both
  images have it, and one half more is for chance.
- *Froxels* end where the light of the farthest lamp fades: lights add up between
  grids with the same end.
- *A draw* of one light in many is right in the mean alone: a noisy method is asked nothing of sums.
- *A map of a light at infinity* spans all media: it is asked nothing of a body far away, which
  makes its texels wide. The maps of how much of a cloud lies before a sun do so, too: a body 320 m
  behind `cumulus-detail` changes its image by 5e-4 with 256 texels on a side, 1e-4 with 512 and
  2e-5 with 1024.
- *Published methods* have the errors of their papers; their exact forms are asked.
- *Grids* lie along the axes of the world, and are turned by a right angle; height fog about the
  vertical. The grid of a cloud is moved without a turn where a method looks it up in a map whose
  texels have one size.
"""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.methods.registry import METHODS, PUBLISHED_METHODS
from airlight.realtime.parameters import defaults
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.check import changes
from airlight.validation.scenes.height_fog import register_height_fog
from airlight.validation.scenes.meshes import rotation
from airlight.validation.scenes.registry import FILES, SCENES
from tests.helpers.area_lights import ring
from tests.helpers.frames import render
from tests.helpers.transport_formula import use_formula

TABLES = {name: table for path in FILES for name, table in tomllib.loads(path.read_text()).items()}
#: Parameters with which a frame is cheap: what is tested does not depend on them.
CHEAP = {"map": 64, "width": 16, "height": 12, "slices": 32}
POINTS = 4  # light samples of an area light
MOST_LIGHTS = 16  # of soft shafts: each filters an image of its own, 667 s for the 512 of fireflies
LAST_BITS = 2.0**-18  # of the brightest pixel: sums of some tens of float32 numbers
ROUNDING, GRAZING = 1e-4, 0.02  # see the module: of the brightest pixel, and of all pixels
CHANCE = 3.0  # errors of texels of both images, one half more
MOVE = (3.7, -2.9, 1.3)  # [m]


@dataclass(frozen=True)
class Image:
    """The image of a scene; None for a scene that the method refuses."""

    airlight: Any
    surface: Any


def parameters(method: str) -> dict[str, Any]:
    """Return parameters of a method with which a frame is cheap."""
    return {name: value for name, value in CHEAP.items() if name in defaults(METHODS[method])}


def has_maps(method: str) -> bool:
    """Return whether a method looks up shadows in maps."""
    made = METHODS[method]()
    return hasattr(made, "map") and getattr(made, "shadow", "map") == "map"


def image(scene: changes.Description, method: str, **more: Any) -> Image | None:
    """Return the image of a scene; None where the method refuses it."""
    try:
        read = read_scene(mi.load_dict(scene, optimize=False))
        frame = render(read, method, **(parameters(method) | {"points": POINTS} | more))
    except InputError:
        return None
    return Image(frame.airlight.astype(np.float64), frame.surface.astype(np.float64))


def described(scene: str, method: str) -> changes.Description:
    """Return a built-in scene; with few of its lights for a method whose recording has a part
    for each of them.
    """
    whole = changes.description(scene)
    if method != "soft-shafts":
        return whole
    return changes.only(whole, changes.lights(whole)[:MOST_LIGHTS])


@lru_cache(maxsize=1)
def plain(scene: str, method: str) -> Image | None:
    """Return the image of a scene as it is."""
    return image(described(scene, method), method)


def beyond(got: Any, expected: Any, within: float = ROUNDING) -> float:
    """Return the fraction of pixels that differ by more than rounding."""
    return float(np.mean(np.abs(got - expected).max(axis=2) > within * np.abs(expected).max()))


def same(got: Image | None, expected: Image | None, within: float) -> None:
    """Demand that two images are the same, to a fraction of the brightest
    pixel; so are two refusals.
    """
    assert (got is None) == (expected is None)
    for part in ("airlight", "surface") if got is not None else ():
        different = beyond(getattr(got, part), getattr(expected, part), within)
        assert different <= (GRAZING if within == ROUNDING else 0.0), part


def sunlit_maps(scene: str, method: str) -> bool:
    """Return whether a method looks up the shadows of a sun in a map."""
    return has_maps(method) and any(light["type"] == "sun" for light in TABLES[scene]["lights"])


def has_grid(scene: str) -> bool:
    """Return whether a scene has a grid of densities."""
    return "smoke" in TABLES[scene].get("fog", {}) or has_cloud_grid(scene)


def has_cloud_grid(scene: str) -> bool:
    """Return whether a cloud of a scene has a grid of densities: its suns have maps of how
    much lies before a point.
    """
    return any("density" in shape.get("medium", {}) for shape in TABLES[scene].get("shapes", ()))


# Relations ----------------------------------------------------------------------------------------


def twice_the_light(scene: str, method: str) -> None:
    """All intensities times 2 double the image."""
    before = plain(scene, method)
    twice = before and Image(2 * before.airlight, 2 * before.surface)
    same(image(changes.brighter(described(scene, method), 2.0), method), twice, within=0.0)


def twice_the_lengths(scene: str, method: str) -> None:
    """Lengths times 2 with the extinction halved and intensities times 4 change nothing."""
    twice = changes.larger(described(scene, method), 2.0)
    same(image(twice, method), plain(scene, method), within=LAST_BITS)


def a_speck(scene: str, method: str) -> None:
    """A speck far behind the camera changes nothing."""
    got = image(changes.with_speck(described(scene, method)), method)
    if sunlit_maps(scene, method):
        same_to_texels(got, plain(scene, method), scene, method)
    else:
        same(got, plain(scene, method), within=LAST_BITS)


def moved(scene: str, method: str) -> None:
    """The world moved and turned with its camera changes nothing beyond
    rounding and the texels of maps.
    """
    fog = TABLES[scene].get("fog", {})
    turn = np.eye(4)
    turn[:3, 3] = MOVE
    squarely = has_maps(method) or has_grid(scene)
    angle = 90.0 if squarely else 37.0
    if has_cloud_grid(scene) and not has_maps(method):
        angle = 0.0  # its texels have one size, and nothing says how wrong they are
    turn[:3, :3] = rotation((0, 0, 1) if squarely or "layers" in fog else (1, 2, 3), angle)
    got = image(changes.moved(described(scene, method), turn), method)
    before = plain(scene, method)
    if has_maps(method):
        same_to_texels(got, before, scene, method)
    else:
        same(got, before, within=ROUNDING)


def same_to_texels(got: Image | None, before: Image | None, scene: str, method: str) -> None:
    """Demand that two images of a scene are the same to the error of the texels of maps."""
    if got is None or before is None:
        same(got, before, within=0.0)
        return
    finer = image(described(scene, method), method, map=4 * CHEAP["map"])
    assert finer is not None
    for part in ("airlight", "surface"):
        one, other, fine = (getattr(each, part) for each in (got, before, finer))
        texels, difference = (float(np.sqrt(np.mean((other - each) ** 2))) for each in (fine, one))
        assert difference <= CHANCE * texels or beyond(one, other) <= GRAZING, part


def two_lights(scene: str, method: str) -> None:
    """Two lights, or two halves of many, are the sum of each."""
    far = {"far": 20.0} if method == "froxel-fog" else {}
    names = changes.lights(described(scene, method))
    if len(names) > 1:
        halves = names[: len(names) // 2], names[len(names) // 2 :]
        one, other = (
            image(changes.only(described(scene, method), half), method, **far) for half in halves
        )
        both = image(described(scene, method), method, **far)
    else:
        more = {"more": changes.another_light(described(scene, method))}
        both = image(described(scene, method) | more, method, **far)
        one = image(described(scene, method), method, **far)
        other = image(changes.only(described(scene, method) | more, ["more"]), method, **far)
    if one is None or other is None:  # a light that the method has not
        assert both is None
        return
    same(both, Image(one.airlight + other.airlight, one.surface + other.surface), within=LAST_BITS)


def bounds(scene: str, method: str) -> None:
    """The bounds of a medium moved where no ray comes change nothing."""
    near, far = (
        image(changes.with_body(described(scene, method), x), method) for x in (320.0, 331.0)
    )
    same(far, near, within=LAST_BITS)


RELATIONS: dict[str, Callable[[str, str], None]] = {
    each.__name__: each
    for each in (twice_the_light, twice_the_lengths, a_speck, moved, two_lights, bounds)
}


def holds(relation: str, scene: str, method: str) -> bool:
    """Return whether a relation is one of a scene and a method; see the rules of the module."""
    if relation == "two_lights":
        return not METHODS[method]().noisy
    if relation == "bounds":
        return "fog" not in TABLES[scene] and not sunlit_maps(scene, method) and not has_grid(scene)
    return True


ALL = [
    (scene, method, relation)
    for scene in SCENES
    for method in METHODS
    if method not in PUBLISHED_METHODS
    for relation in RELATIONS
    if holds(relation, scene, method)
]
#: Each relation, each kind of scene (no occluder, a spot, bounds under a sun, area lights, many
#: lights, height fog under lamps and a sun, a grid, clouds) and each method at least once.
QUICK = {
    ("open-fog", "unshadowed"): ("a_speck", "two_lights"),
    ("open-fog", "shadow-planes"): ("a_speck",),
    ("sphere-spot", "light-volumes"): ("twice_the_lengths", "moved"),
    ("sphere-spot", "min-max"): ("a_speck", "twice_the_light"),
    ("sphere-spot", "froxel-fog"): ("two_lights", "a_speck"),
    ("windows", "shadow-planes"): ("bounds", "moved"),
    ("penumbra-plane", "ray-march"): ("a_speck", "twice_the_lengths"),
    ("penumbra-plane", "soft-shafts"): ("two_lights",),
    ("lanterns", "equi-angular"): ("moved", "twice_the_light"),
    ("street", "ray-march"): ("twice_the_lengths", "moved"),
    ("meadow", "unshadowed"): ("moved", "two_lights"),
    ("smoke", "ray-march"): ("moved",),
    ("cloud-slab", "cloud-octaves"): ("two_lights", "moved"),
    ("step-cloud", "cloud-octaves"): ("moved",),
    ("cloud-slab", "cloud-collectors"): ("twice_the_lengths", "twice_the_light"),
}


@pytest.fixture(autouse=True)
def _cheap_clouds(variant, monkeypatch):
    register_height_fog()
    use_formula(monkeypatch)


@pytest.mark.claim("metamorphic")
@pytest.mark.parametrize(
    ("scene", "method", "relation"),
    [
        pytest.param(*each, marks=() if each[2] in QUICK.get(each[:2], ()) else pytest.mark.slow)
        for each in ALL
    ],
)
def test_what_changes_nothing_changes_nothing(scene, method, relation):
    RELATIONS[relation](scene, method)
    # a refusal holds for all
    assert (scene, method) not in QUICK or plain(scene, method) is not None


@pytest.mark.claim("metamorphic")
def test_a_speck_changes_nothing_of_a_lamp_that_shadows_itself():
    """No built-in scene has a lone light in its own way: with any occluder it cast its
    shadow, and without it none.
    """
    scene = changes.description("open-fog")
    del scene["lamp"]
    before, after = (
        image(change(scene | {"ring": ring((0.3, 0.4, 1.1))}), "ray-march")
        for change in (dict, changes.with_speck)
    )
    assert before is not None
    same(after, before, LAST_BITS)
