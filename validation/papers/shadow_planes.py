# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes of Biri 2006: the errors of their order and other shortcuts in images, and
the stencil along a ray.

Errors are relative RMSE and relative bias of the airlight against the quadrature. Whether an error
is noticeable is judged on an 8-bit display: the number of its 255 steps within which 99 % of pixels
are right; `white` is 255.

The stencil of sections 5 and 5.1.5 needs no image. Along a ray a shadow is an interval [a, b]. Its
plane at a faces the camera, its plane at b faces away. Planes are drawn from the surface towards
the camera: one that faces the camera adds Gamma(a) where the stencil is 1, one that faces away
subtracts Gamma(b) where it is 0. In section 5, stage 5, planes that face the camera then increment
the stencil; in 5.1.5 they decrement it. Any increasing function serves as Gamma; x does.
"""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from airlight.analytic.geometry import foot_and_height
from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.read import read_reference
from airlight.validation.arrays import Array, Bools
from airlight.validation.metrics.errors import Metrics, error_metrics, known
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.scenes.parts import Plugin, camera, fog, point_light
from airlight.validation.study.configuration import configuration, prepared

SIZE = (160, 120)  #: of the images [pixels]
SCENES = ("two-pens", "clutter", "hall", "colonnade")  #: whose planes are ordered

_RAYS = 4000  # of the stencil


def orders() -> dict[str, float]:
    """Return the errors without shadows, without an order of the planes,
    and in the paper's order.
    """
    paper, others = [], {}
    for name in SCENES:
        scene, true = _opened(name)
        paper.append(_error(scene, true, order="paper"))
        if name == "clutter":
            others["clutter, no order"] = _error(scene, true, order="none")
        if name == "hall":
            others["hall, unshadowed"] = _error(scene, true, method="unshadowed")
            others["hall, paper's order"] = paper[-1]
    return {
        **{name: known(error.relative_rmse) for name, error in others.items()},
        "paper's order, largest": max(known(error.relative_rmse) for error in paper),
        "paper's order, p99": max(known(error.p99) for error in paper),
    }


def shortcuts() -> dict[str, float]:
    """Return the errors of the polynomial, of Gamma at the vertices and of an 8-bit buffer.

    `near, steps`: see `_steps`. `vertex`: Gamma at the vertices, in `two-pens`. `bright, bias` and
    `dim, bias`: of an 8-bit buffer in `clutter`, over the pixels whose reference is below white,
    which is a quarter of the brightest airlight of 99 % of the pixels, and four times as much.
    """
    scene, true = _opened("clutter")
    # White at a quarter of the brightest airlight clips bright pixels; white at four times the
    # brightest leaves few steps for dim pixels.
    brightest = float(np.percentile(true.max(axis=2), 99))
    biases = {}
    for name, white in (("bright", brightest / 4), ("dim", 4 * brightest)):
        image = _rendered(scene, order="exact", buffer="8bit", white=white)
        below = true < white
        biases[f"{name}, bias"] = float((image - true)[below].sum() / true[below].sum())
    vertex = _error(*_opened("two-pens"), order="exact", evaluation="vertex")
    return {"near, steps": _steps(), "vertex": known(vertex.relative_rmse), **biases}


def _steps() -> float:
    """Return by how many of 255 steps of a display the paper's polynomial is off in 99 %
    of the pixels near a lamp.

    The lamp stands in front of the camera, before which the whole fog is lit; near is within 10
    degrees of the lamp. White is the brightest radiance of 99 % of the picture.
    """
    scene = mi.load_dict(_lamp_in_fog(0.3))  # optical depth between camera and light
    resize(scene, SIZE)
    read = read_scene(scene)
    # Without shadows: only the polynomial differs.
    true, shown = (_rendered(read, "unshadowed", kernel) for kernel in ("exact", "taylor"))
    white, near = float(np.percentile(true, 99)), _close_to_lamp(scene)
    # As a display shows it: clipped at white, in 255 steps.
    on_screen = [255 * np.clip(image[near] / white, 0, 1) for image in (true, shown)]
    return float(np.percentile(np.abs(on_screen[1] - on_screen[0]).max(axis=1), 99))


def _lamp_in_fog(depth: float) -> Plugin:
    distance = 5.3
    return {
        "type": "scene",
        "fog": fog(depth / distance, (0.93, 0.93, 0.93)),
        "sensor": camera((0.31, -distance, 1.13), (0.37, 0.0, 0.91), fov=58.3, size=SIZE),
        "lamp": point_light((0.33, 0.03, 1.17), (23.1, 23.1, 23.1)),
    }


def _close_to_lamp(scene: mi.Scene) -> Bools:
    reference = read_reference(scene)
    foot, height = foot_and_height(
        reference.origin, reference.direction, reference.lights[0].position
    )
    # The angle at the camera between the ray and the light: height over foot.
    return (np.arctan2(height, foot) < np.radians(10)).reshape(reference.height, reference.width)


def _opened(name: str) -> tuple[Scene, Array]:
    """Return a scene, and the airlight of its reference."""
    loaded = load_scene(name, SIZE).scene
    return read_scene(loaded), reference_image(loaded).airlight


def _rendered(
    scene: Scene, method: str = "shadow-planes-2006", kernel: str = "exact", **values: str | float
) -> Array:
    frame = render_frame(prepared(scene, configuration(method, kernel, values)))
    return np.asarray(frame.airlight, dtype=np.float64)


def _error(scene: Scene, true: Array, **values: str) -> Metrics:
    return error_metrics(true, _rendered(scene, **values))


def stencil() -> dict[str, float]:
    """Return the fraction of random rays with up to five overlapping shadows whose
    lit length comes out right.

    They are `section 5.1.5` and `stage 5`, by the rules that these print.
    """
    random = np.random.default_rng(65)
    rays = [_shadows(random) for _ in range(_RAYS)]
    right = {
        name: [abs(drawn(ray, step) - _lit_length(ray)) < 1e-9 for ray in rays]
        for name, step in (("section 5.1.5", -1), ("stage 5", 1))
    }
    return {name: float(np.mean(each)) for name, each in right.items()}


def _shadows(random: np.random.Generator) -> list[tuple[float, float]]:
    """Return shadows on a ray from the camera at 0, in the light, to the surface at 1."""
    pairs = np.sort(random.uniform(0, 1.3, (int(random.integers(1, 6)), 2)), axis=1)
    return [(float(a), float(b)) for a, b in pairs]


def drawn(shadows: list[tuple[float, float]], step: int) -> float:
    """Return the sum that is drawn; planes that face the camera add `step` to the stencil, and
    planes that face away subtract it.
    """
    # The stencil begins with the number of shadows that the surface lies in.
    level = sum(a < 1 < b for a, b in shadows)
    planes = sorted(
        [(a, True) for a, _ in shadows] + [(b, False) for _, b in shadows], reverse=True
    )
    # The surface itself closes the last lit interval, with Gamma(1), if it is lit.
    total = 1.0 if level == 0 else 0.0
    for x, front in planes:
        # A plane behind the surface is hidden by it.
        if x >= 1:
            continue
        # Front planes count where the stencil is 1, back planes where it is 0: only the border
        # between light and shadow is drawn, not the borders within overlapping shadows.
        if level == (1 if front else 0):
            total += x if front else -x
        level += step if front else -step
    return total


def _lit_length(shadows: list[tuple[float, float]]) -> float:
    """Return the length of the ray that lies in no shadow, by cutting it at all ends."""
    cuts = np.unique(np.clip([0.0, 1.0, *(end for pair in shadows for end in pair)], 0, 1))
    middles = 0.5 * (cuts[1:] + cuts[:-1])
    lit = [not any(a < x < b for a, b in shadows) for x in middles]
    return float(np.sum(np.diff(cuts)[lit]))
