# SPDX-License-Identifier: BSD-3-Clause
"""The truth of a scene, from the cache where it was computed before, and what the image of a renderer holds of it."""

from collections.abc import Callable, Mapping
from dataclasses import Field, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.image import quadrature_image
from reference.quadrature.ray_values import TruthImage
from reference.quadrature.replicates import Keep
from reference.quadrature.surface import surface_hits
from reference.scene.read import TruthScene, read_truth
from reference.storage.cache import drop_arrays
from reference.storage.exr import TOTAL
from reference.storage.kept import Kept, Spent, is_kept, kept, key_of, load, stopwatch, store
from reference.storage.scene_digest import scene_digest
from validation.estimates.light_on_ray import check_camera, check_rays, check_values

Progress = Callable[[int, int, str], None]

_USUAL: dict[str, Any] = {"checks": 32, "shadow_scale": 1.0, "pixel": "centre"}


def truth_image(
    scene,
    *,
    checks: int = 32,
    shadow_scale: float = 1.0,
    pixel: str = "centre",
    progress: Progress | None = None,
) -> TruthImage:
    """Return the quadrature truth of a Mitsuba scene at its own size, (height, width, 3) [W/(m^2 sr)].

    `checks`, `shadow_scale`, `pixel` and `progress` are those of `reference.quadrature.image.quadrature_image`.
    Radiance that is not finite is refused, see `validation.estimates.light_on_ray`.
    """
    settings: dict[str, Any] = {"checks": checks, "shadow_scale": shadow_scale, "pixel": pixel}
    return kept_truth(scene, settings, progress=progress)[0]


def kept_truth(
    scene, settings: Mapping[str, Any] = MappingProxyType(_USUAL), *, progress: Progress | None = None
) -> tuple[TruthImage, Kept]:
    """Return what `truth_image` does, and how it is kept: what it took, and whether it was there already."""
    key, spent = _key(scene, settings), stopwatch()
    stored = load(key)
    if stored is not None:
        values = {each.name: _as_kept(each, stored.arrays.get(each.name)) for each in fields(TruthImage)}
        return TruthImage(**values), stored
    truth = read_truth(scene)
    parts = _Parts(key)
    # Only area lights take so long that a run is worth going on with.
    keep = parts if truth.area and settings["pixel"] == "centre" else None
    image = _checked_image(truth, settings, keep=keep, progress=progress)
    stored = _store(key, image, spent())
    parts.drop()
    return image, stored


def truth_of_pixels(scene, pixels: NDArray[np.integer]) -> TruthImage:
    """Return the quadrature truth of pixels of a Mitsuba scene by number, row by row, (1, count, 3); it is not kept."""
    whole = read_truth(scene)
    return _checked_image(replace(whole, width=len(pixels), height=1, direction=whole.direction[pixels]), _USUAL)


def _checked_image(
    truth: TruthScene, settings: Mapping[str, Any], *, keep: Keep | None = None, progress: Progress | None = None
) -> TruthImage:
    """Return the truth of an image whose every value is finite."""
    check_camera(truth)
    if settings["pixel"] == "centre":
        check_rays(truth, surface_hits(truth).distance)
    image = quadrature_image(truth, **settings, keep=keep, progress=progress)
    check_values(truth, image)
    return image


def keep_truth(scene, image: TruthImage, spent: Spent, *, pixel: str = "centre") -> None:
    """Keep a truth that another process computed by `truth_image`, and what it took, so that this one finds it."""
    _store(_key(scene, _USUAL | {"pixel": pixel}), image, spent)


def has_truth(scene, *, pixel: str = "centre") -> bool:
    """Return whether the truth of a scene is kept."""
    return is_kept(_key(scene, _USUAL | {"pixel": pixel}))


def _key(scene, settings: Mapping[str, Any]) -> str:
    return key_of("quadrature", quadrature_image, scene=scene_digest(scene), **settings)


def _store(key: str, image: TruthImage, spent: Spent) -> Kept:
    values = {each.name: getattr(image, each.name) for each in fields(TruthImage)}
    return store(key, {name: value for name, value in values.items() if value is not None}, spent)


class _Parts:
    """Parts of a truth, kept until it is done: a run that was interrupted goes on from them."""

    def __init__(self, key: str) -> None:
        self._key, self._names = key, list[str]()

    def __call__(self, name: str, work: Callable[[], Mapping[str, Any]]) -> Mapping[str, Any]:
        self._names.append(f"{self._key}/{name}")
        return kept(self._names[-1], work).arrays

    def drop(self) -> None:
        """Forget all parts."""
        for name in self._names:
            drop_arrays(name)


def _as_kept(field: Field, value: Any) -> Any:
    """Return an array, or the number that was stored as an array without dimensions."""
    return field.type(value) if field.type in (int, float) else value


Array = NDArray[np.float64]


def reference_layer(truth: TruthImage, layer: str, *, emitted: bool = True) -> Array:
    """Return 'airlight', 'surface' or 'total', (height, width, 3) [W/(m^2 sr)].

    A renderer shows the area lights that the camera sees: Mitsuba's integrators do unless `hide_emitters` is set, and
    so do those of Blender for an emitting mesh. So `total` is airlight, lit surface and `emitted` together. It is
    without `emitted` where a file has that as a layer beside it, as the files of `airlight reference` do, and for
    frames of our own methods, which show no light. Where a renderer hides its lights (Blender's light objects by
    default, `hide_emitters`), compare the layer `airlight`, or leave the lights out here.
    """
    if layer != TOTAL:
        return np.asarray(getattr(truth, layer))
    total = truth.airlight + truth.surface
    return total if truth.emitted is None or not emitted else total + truth.emitted


def reference_error(truth: TruthImage, layer: str) -> Array | None:
    """Return the standard error of a layer, (height, width, 3) [W/(m^2 sr)]; None without area lights, where it is 0.

    Airlight and surface have draws of their own, so that the variances of the total add up; what lights emit is exact.
    """
    if truth.airlight_se is None or truth.surface_se is None:
        return None
    if layer == TOTAL:
        return np.hypot(truth.airlight_se, truth.surface_se)
    return np.asarray(getattr(truth, f"{layer}_se"))
