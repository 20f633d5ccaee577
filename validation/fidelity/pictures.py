# SPDX-License-Identifier: BSD-3-Clause
"""What the shortcuts of both papers cost in images: small frames of the built-in scenes against the truth.

The errors are relative RMSE and relative bias of the airlight. Noticeable is what an 8-bit display shows: the share of
pixels whose value on it is off by more than one of 255 steps, with the radiance `white` shown as 255.
"""

from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.geometry import foot_and_height
from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from reference.quadrature.surface import surface_hits
from reference.scene.read import TruthScene, read_truth
from reference.visibility.lit_intervals import lit_intervals
from reference.visibility.spot_cone import perpendicular
from validation.configurations.methods import configuration, prepared
from validation.estimates.quadrature import truth_image
from validation.metrics.errors import error_metrics
from validation.scenes.colonnade import colonnade
from validation.scenes.loading import load_scene, resize
from validation.scenes.parts import point_light

Array = NDArray[np.float64]

SIZE = (160, 120)  #: of the images [pixels]
#: Scenes of the orders of shadow planes, and what is rendered in each.
CASTERS = ("two-pens", "clutter", "hall", "colonnade")
VARIANTS: Mapping[str, tuple[str, str, Mapping[str, Any]]] = {
    "exact": ("shadow-planes", "exact", {}),
    "paper": ("shadow-planes", "exact", {"order": "paper"}),
    "none": ("shadow-planes", "exact", {"order": "none"}),
    "unshadowed": ("unshadowed", "exact", {}),
}
_MAPS = (32, 128, 512)  # of Fig. 6 of Billeter 2010 [texels]
_DISTANCES = {"near": 0.3, "far": 6.0}  # optical depths between camera and light


def orders() -> dict[str, Any]:
    """Return the errors of the orders of shadow planes, by scene and variant."""
    return {scene: {name: _error(scene, *how) for name, how in VARIANTS.items()} for scene in CASTERS}


def shortcuts() -> dict[str, Any]:
    """Return the errors of other shortcuts of Biri 2006.

    Returns
    -------
    dict
        `pixel`, `vertex` (Gamma at the vertices, in `two-pens`); in `clutter` with an 8-bit buffer `bright` (white is a
        quarter of the brightest airlight of 99 % of the pixels; `bias` over those whose truth is below white) and `dim`
        (white is 4 times as much; `relative_rmse` to the truth cut off at white); `taylor` and `exact` (in `hall`).
    """
    planes: dict[str, dict[str, Any]] = {"pixel": {}, "vertex": {"evaluation": "vertex"}}
    errors = {name: _error("two-pens", "shadow-planes", "exact", values) for name, values in planes.items()}
    errors |= {kernel: _error("hall", "shadow-planes", kernel, {}) for kernel in ("taylor", "exact")}
    true = _truth("clutter").airlight
    brightest = float(np.percentile(true.max(axis=2), 99))
    for name, white in (("bright", brightest / 4), ("dim", 4 * brightest)):
        image = _rendered("clutter", "shadow-planes", "exact", {"buffer": "8bit", "white": white})
        below = true < white
        errors[name] = {
            "bias": float((image - true)[below].sum() / true[below].sum()),
            "relative_rmse": error_metrics(np.minimum(true, white), image).relative_rmse,
        }
    return errors


def levels() -> dict[str, Any]:
    """Return the share of pixels where the polynomial of Biri 2006 is noticeably wrong.

    The picture is that of a lamp in front of the camera, before which the whole fog is lit, at two optical depths from
    the camera: `near` within 10 degrees of the lamp, `far` over the whole image. White is the brightest radiance of 99
    % of the near picture, and stays.

    Returns
    -------
    dict
        `near`, `far`: `noticeable` [1], `relative_rmse`.
    """
    white, distances = None, {}
    for name, depth in _DISTANCES.items():
        scene = mi.load_dict(_lamp_in_fog(depth))
        resize(scene, SIZE)
        read = read_scene(scene)
        true, shown = (
            render_frame(prepared(read, configuration("unshadowed", kernel))).airlight for kernel in ("exact", "taylor")
        )
        true, shown = true.astype(np.float64), shown.astype(np.float64)
        white = white or float(np.percentile(true, 99))
        at = _close_to_lamp(scene) if name == "near" else np.ones(true.shape[:2], dtype=bool)
        on_screen = [255 * np.clip(image[at] / white, 0, 1) for image in (true, shown)]
        distances[name] = {
            "noticeable": float(np.mean(np.abs(on_screen[1] - on_screen[0]).max(axis=1) > 1)),
            "relative_rmse": error_metrics(true, shown, mask=at).relative_rmse,
        }
    return distances


def _lamp_in_fog(depth: float) -> dict[str, Any]:
    from validation.scenes.parts import camera, fog

    distance = 5.3
    return {
        "type": "scene",
        "fog": fog(depth / distance, (0.93, 0.93, 0.93)),
        "sensor": camera((0.31, -distance, 1.13), (0.37, 0.0, 0.91), fov=58.3, size=SIZE),
        "lamp": point_light((0.33, 0.03, 1.17), (23.1, 23.1, 23.1)),
    }


def _close_to_lamp(scene: Any) -> NDArray[np.bool_]:
    truth = read_truth(scene)
    foot, height = foot_and_height(truth.origin, truth.direction, truth.lights[0].position)
    return (np.arctan2(height, foot) < np.radians(10)).reshape(truth.height, truth.width)


def maps() -> dict[str, Any]:
    """Return what the size of the map changes in `omni-box`.

    Returns
    -------
    dict
        `errors` against the truth by size, and `between`: the relative RMSE of the image of 128 texels to that of 512.
    """
    images = {size: _rendered("omni-box", "light-volumes", "exact", _walk(size)) for size in _MAPS}
    true = _truth("omni-box").airlight
    return {
        "errors": {str(size): error_metrics(true, image).relative_rmse for size, image in images.items()},
        "between": error_metrics(images[512], images[128]).relative_rmse,
    }


def _walk(size: int) -> dict[str, Any]:
    return {"evaluation": "walk", "walls": "slanted", "map": size}


def slices() -> dict[str, Any]:
    """Return the errors of epipolar slices in `colonnade`.

    Returns
    -------
    dict
        `pixel` (a walk for every pixel), `samples` (interpolated), and `volume` (a light volume of the same map).
    """
    how = {"pixel": {"sampling": "pixels"}, "samples": {}}
    errors = {name: _error("colonnade", "min-max", "exact", {**values, "map": 512}) for name, values in how.items()}
    return errors | {"volume": _error("colonnade", "light-volumes", "exact", _walk(512))}


def two_lights() -> dict[str, Any]:
    """Return the errors of light volumes in a hall with two lamps, each with a map of 1024 texels."""
    scene = two_lamps()
    read, true = read_scene(scene), truth_image(scene).airlight
    errors = {}
    for name, values in (("mesh", {"evaluation": "mesh", "map": 1024}), ("upright", {"map": 1024})):
        image = render_frame(prepared(read, configuration("light-volumes", "exact", values))).airlight
        errors[name] = error_metrics(true, image).relative_rmse
    return errors


def two_lamps(size: tuple[int, int] = SIZE) -> Any:
    """Return the `mi.Scene` of the hall of columns with two lamps: our own for Fig. 1 of Billeter 2010."""
    described = colonnade()
    described["lamp-2"] = point_light((-0.73, 3.31, 6.23), (97.0, 103.0, 111.0))
    scene = mi.load_dict(described)
    resize(scene, size)
    return scene


def shadows() -> dict[str, Any]:
    """Return how the rays of the truth are lit.

    Returns
    -------
    dict
        `most_segments` (lit segments of a ray in `clutter`), `span` (mean share of a ray in `colonnade` between the
        first and the last crossing of a shadow plane, over rays that cross one).
    """
    ray, _, _, _ = _lit("clutter")
    return {"most_segments": int(np.bincount(ray).max()), "span": _span("colonnade")}


def _lit(name: str) -> tuple[NDArray[np.int64], Array, Array, tuple[TruthScene, Array, Array, Array]]:
    """Return ray, beginning and end of the lit segments [m], and the scene with foot, height and depth of its rays."""
    truth = read_truth(load_scene(name, (96, 72)).scene)
    light, depth = truth.lights[0], surface_hits(truth).distance
    foot, height = foot_and_height(truth.origin, truth.direction, light.position)
    normal = perpendicular(truth.origin, truth.direction, light)
    ends = np.arctan2(-foot, height), np.where(np.isfinite(depth), np.arctan2(depth - foot, height), np.pi / 2)
    lit = lit_intervals(truth, light, (truth.direction, normal, height), ends=ends)
    low, high = (foot[lit.ray] + height[lit.ray] * np.tan(angle) for angle in (lit.low, lit.high))
    return lit.ray, low, high, (truth, foot, height, depth)


def _span(name: str) -> float:
    ray, low, high, (_, _, _, depth) = _lit(name)
    first, last = np.full(len(depth), np.inf), np.zeros(len(depth))
    for x in (low, high):
        inside = (x > 1e-4 * depth[ray]) & (x < (1 - 1e-4) * depth[ray])
        np.minimum.at(first, ray[inside], x[inside])
        np.maximum.at(last, ray[inside], x[inside])
    crossed = np.isfinite(first) & np.isfinite(depth)
    return float(np.mean((last - first)[crossed] / depth[crossed]))


def _error(scene: str, method: str, kernel: str, values: Mapping[str, Any]) -> dict[str, float]:
    error = error_metrics(_truth(scene).airlight, _rendered(scene, method, kernel, values))
    return {"relative_rmse": error.relative_rmse, "relative_bias": error.relative_bias, "p99": error.p99}


def _truth(scene: str) -> Any:
    return truth_image(load_scene(scene, SIZE).scene)


def _rendered(scene: str, method: str, kernel: str, values: Mapping[str, Any]) -> Array:
    read = read_scene(load_scene(scene, SIZE).scene)
    frame = render_frame(prepared(read, configuration(method, kernel, values)))
    return np.asarray(frame.airlight, dtype=np.float64)
