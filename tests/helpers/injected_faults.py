# SPDX-License-Identifier: BSD-3-Clause
"""Faults that are injected into the reference of a scene, to count how often
the diagnosis names them.

Where a fault is one of the scene, such as another extinction, the image is the certified reference
of the changed scene (`reference.quadrature`), by code that the hypotheses do not have: adaptive
integrals in the place of fixed nodes. A change of an image is made to that of the right scene too.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.analytic.phase import HenyeyGreenstein
from airlight.reference.quadrature.image import ReferenceImage, quadrature_image
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene.area_light import is_area
from airlight.reference.scene.camera import film_directions, pixel_centres
from airlight.reference.scene.directional_light import is_directional
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.validation.engine.curves import agx, blender_filmic, filmic, to_srgb
from airlight.validation.estimates.quadrature import reference_layer
from airlight.validation.fog_model.view import Scenery

Array = NDArray[np.float64]

_CHECKS = 2  # random shadow rays to each ray
_POINTS = 128  # of area lights: 0.03 % off in the mean
_HOLDS = "total"
_FOOT = 0.3048  # [m]
_LOBE = HenyeyGreenstein(0.43)

Make = Callable[[ReferenceScene], Array | None]


@dataclass(frozen=True)
class Injected:
    """A fault with the name that a diagnosis should give it."""

    name: str
    words: str
    make: Make | None = None  #: the image of a scene with the fault; None: the scene is right
    values: Callable[[Array], Array | None] | None = None  #: what is done to the image then

    def image(self, reference: ReferenceScene) -> Array | None:
        """Return the image, (height, width, 3), or None where the scene cannot have the fault."""
        image = right_image(reference) if self.make is None else self.make(reference)
        return image if image is None or self.values is None else self.values(image)


def _quadrature(reference: ReferenceScene, **how: Any) -> ReferenceImage:
    return quadrature_image(reference, checks=_CHECKS, plan=PointPlan(most=_POINTS), **how)


def _total(image: ReferenceImage) -> Array:
    return reference_layer(image, _HOLDS, emitted=False)  # pixels that show a light take no part


def right_image(reference: ReferenceScene) -> Array:
    """Return the image of a scene without a fault, (height, width, 3)."""
    return _total(_quadrature(reference))


def _of_scene(
    change: Callable[[ReferenceScene], ReferenceScene | None],
) -> Callable[[ReferenceScene], Array | None]:
    def image(reference: ReferenceScene) -> Array | None:
        changed = change(reference)
        return None if changed is None else _total(_quadrature(_with_emitters(changed)))

    return image


def _with_emitters(reference: ReferenceScene) -> ReferenceScene:
    """Return a scene whose point and spot lights are Mitsuba's too: the
    light on surfaces is theirs.
    """
    whole = reference.scene
    near = iter(reference.lights)
    emitters = [
        emitter if is_directional(emitter) else mi.load_dict(_emitter(next(near)))
        for emitter in whole.emitters()
        if not is_area(emitter)
    ]
    parts = [*whole.sensors(), *whole.shapes(), *emitters]
    return replace(
        reference,
        scene=mi.load_dict({"type": "scene"} | {f"part{n}": part for n, part in enumerate(parts)}),
    )


def _emitter(light: ReferenceLight) -> dict[str, Any]:
    intensity = {"type": "rgb", "value": [float(value) for value in light.intensity]}
    if light.axis is None:
        return {
            "type": "point",
            "position": [float(value) for value in light.position],
            "intensity": intensity,
        }
    across = np.cross(light.axis, np.eye(3)[int(np.argmin(np.abs(light.axis)))])
    across /= np.linalg.norm(across)
    matrix = np.eye(4)
    matrix[:3] = np.stack(
        [across, np.cross(light.axis, across), light.axis, light.position], axis=1
    )
    angles = {
        "cutoff_angle": float(np.rad2deg(light.cutoff)),
        "beam_width": float(np.rad2deg(light.beam)),
    }
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f(matrix),
        "intensity": intensity,
        **angles,
    }


def _media(reference: ReferenceScene, change: Callable[[Any], Any]) -> ReferenceScene:
    return replace(
        reference,
        medium=change(reference.medium),
        media=tuple(change(medium) for medium in reference.media),
    )


def _optics(
    change: Callable[[Array, Array], tuple[Array, Array]],
) -> Callable[[ReferenceScene], ReferenceScene]:
    def changed(medium: Any) -> Any:
        sigma_t, albedo = change(medium.sigma_t, medium.albedo)
        return replace(medium, sigma_t=sigma_t, albedo=albedo)

    return lambda reference: _media(reference, changed)


def _absorption(factor: float) -> Callable[[Array, Array], tuple[Array, Array]]:
    def change(sigma_t: Array, albedo: Array) -> tuple[Array, Array]:
        scattering = sigma_t * albedo
        extinction = scattering + factor * (sigma_t - scattering)
        return extinction, np.divide(
            scattering, extinction, out=albedo.copy(), where=extinction > 0
        )

    return change


def _scenery(
    wanted: Callable[[ReferenceScene], bool], **given: Any
) -> Callable[[ReferenceScene], ReferenceScene | None]:
    return lambda reference: (
        replace(reference, lights=Scenery(**given).lights(reference)) if wanted(reference) else None
    )


def _spots(reference: ReferenceScene) -> bool:
    return any(light.axis is not None for light in reference.lights)


def _pixels(
    reference: ReferenceScene, change: Callable[[Array, tuple[int, int]], Array]
) -> ReferenceScene:
    """Return a scene whose rays go through other places on the film."""
    size = reference.width, reference.height
    sensor = reference.scene.sensors()[0]
    return replace(
        reference, direction=film_directions(sensor, change(pixel_centres(size), size), size)
    )


def _other_axis(positions: Array, size: tuple[int, int]) -> Array:
    middle = 0.5 * np.array(size)
    return middle + (size[0] / size[1]) * (positions - middle)


def _darker_corners(reference: ReferenceScene) -> Array:
    """Return an image as a lens shows it: attenuated by the fourth power of the
    cosine, here 1/sqrt(1 + tan^2).
    """
    width, height = reference.width, reference.height
    half = np.tan(0.5 * np.deg2rad(float(mi.traverse(reference.scene.sensors()[0])["x_fov"][0])))
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    across, along = half * (2 * column / width - 1), half * (2 * row - height) / width
    return right_image(reference) / (1 + across**2 + along**2)[..., None] ** 2


def _near_lights(reference: ReferenceScene) -> bool:
    return bool(reference.lights)


def _in_feet(reference: ReferenceScene) -> ReferenceScene | None:
    """Return a scene whose lengths are 1/0.3048 times as long, brought back to size:
    lamps and media are not.

    Without lamps that is another extinction, and nothing else.
    """
    if not reference.lights:
        return None
    lights = tuple(
        replace(light, intensity=light.intensity * _FOOT**2) for light in reference.lights
    )
    return replace(_optics(lambda s, a: (s / _FOOT, a))(reference), lights=lights)


def _clamped(image: Array) -> Array | None:
    return np.minimum(image, np.quantile(image[image > 0], 0.9))


def _swapped(image: Array) -> Array | None:
    return image[..., ::-1] if np.ptp(image, axis=2).max() > 1e-3 * image.max() else None


INJECTED = (
    Injected("right", "nothing"),
    Injected("factor", "1.07 times as bright", values=lambda image: 1.07 * image),
    Injected("factor", "4 pi times as bright", values=lambda image: 4 * np.pi * image),
    Injected(
        "extinction", "the extinction 1.4 times", _of_scene(_optics(lambda s, a: (1.4 * s, a)))
    ),
    Injected("unit-length", "feet for metres", _of_scene(_in_feet)),
    Injected("absorption", "no absorption", _of_scene(_optics(_absorption(0.0)))),
    Injected("albedo", "the albedo twice", _of_scene(_optics(lambda s, a: (s, a * a)))),
    Injected(
        "albedo", "the albedo left out", _of_scene(_optics(lambda s, a: (s, np.ones_like(a))))
    ),
    Injected(
        "sigma-s",
        "extinction for scattering",
        _of_scene(_optics(lambda s, a: (s / np.maximum(a, 1e-9), a))),
    ),
    Injected(
        "g",
        "another g",
        _of_scene(lambda reference: _media(reference, lambda m: replace(m, phase=_LOBE))),
    ),
    Injected("spot-angle", "cones twice as wide", _of_scene(_scenery(_spots, cone=2.0))),
    Injected("spot-angle", "cones half as wide", _of_scene(_scenery(_spots, cone=0.5))),
    Injected(
        "light-position",
        "the light moved",
        _of_scene(_scenery(_near_lights, moved=((0.07, -0.05, 0.09),))),
    ),
    Injected(
        "fov-axis",
        "the other field of view",
        _of_scene(lambda reference: _pixels(reference, _other_axis)),
    ),
    Injected(
        "shift",
        "half a pixel",
        _of_scene(lambda reference: _pixels(reference, lambda p, size: p - [0.5, 0.5])),
    ),
    Injected("flip", "upside down", values=lambda image: image[::-1]),
    Injected("flip", "mirrored", values=lambda image: image[:, ::-1]),
    Injected("transfer", "sRGB", values=to_srgb),
    Injected("transfer", "gamma 2.2", values=lambda image: image ** (1 / 2.2)),
    Injected("clamp", "a tenth cut off", values=_clamped),
    Injected("tone-map", "filmic", values=filmic),
    Injected("tone-map", "Blender's Filmic", values=blender_filmic),
    Injected("tone-map", "Blender's AgX", values=agx),
    Injected(
        "black-level",
        "a twentieth of the mean added",
        values=lambda image: image + 0.05 * image.mean(),
    ),
    Injected("vignette", "corners darker by cos^4", _darker_corners),
    Injected("channels", "B, G, R", values=_swapped),
)
