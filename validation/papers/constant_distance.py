# SPDX-License-Identifier: BSD-3-Clause
"""How wrong is the constant R of Biri 2006, section 4.2, as a function of a medium's size and optical depth?

The camera looks at a sphere of one medium in clear air, which a lamp outside the sphere lights from above. Two numbers
matter: the radius over the distance of the lamp, which determines how much 1/r^2 varies in the sphere, and the optical
depth of the diameter, which determines how much the attenuation varies. Every pair is rendered with ``media=paper`` and
with ``media=exact``, in float64. The study compares the first image with the second, which tests compare with the
truth; on request it compares with the truth itself.

R, the mean distance between a point of the boundary and a point of the medium, is 1.2 radii in a sphere. A leg from far
away has a mean length of 0.75 radii within the sphere (the mean of half a chord over the volume): R is 60 % too long,
and the airlight too dark by about exp(-0.45 sigma_t radius). `scale` is the factor that brings the paper's image
closest to the exact one. `shape` is the error that remains after this scaling: no choice of R could remove it. Beside
them stand the errors of the polynomial for this form, of degree 4 as in the paper, and of the equation as printed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from analytic.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from validation.configurations.methods import configuration, prepared
from validation.estimates.quadrature import truth_image
from validation.metrics.errors import error_metrics
from validation.scenes.parts import camera

SIZES = (0.05, 0.17, 0.43, 0.83)  #: radius over the distance from the lamp to the centre
OPTICAL_DEPTHS = (0.03, 0.31, 1.1, 3.1, 9.7)  #: of the diameter
_LAMP = np.array([0.37, -0.31, 3.07])  # [m]
_RADIUS = 0.97  # [m]


@dataclass(frozen=True)
class ConstantDistance:
    """The error of one medium with the constant R."""

    size: float  #: radius over the distance of the lamp
    optical_depth: float  #: of the diameter
    relative_rmse: float  #: over the pixels that see the medium
    relative_bias: float
    scale: float  #: factor that brings the image closest to the exact one
    shape: float  #: relative RMSE that remains after scaling by this factor
    polynomial: float  #: relative RMSE of the same by the kernel 'taylor'
    printed: float  #: relative RMSE of the equation as printed, summed over nodes


def constant_distance_study(
    *,
    sizes: Sequence[float] = SIZES,
    optical_depths: Sequence[float] = OPTICAL_DEPTHS,
    image: tuple[int, int] = (64, 48),
    against: str = "exact",
    progress: Callable[[int, int, str], None] | None = None,
) -> tuple[ConstantDistance, ...]:
    """Measure the error of the constant R for media of several sizes and optical depths.

    Parameters
    ----------
    sizes
        Radii over the distance of the lamp, above 0 and below 1, so that the lamp is outside the medium.
    optical_depths
        Optical depths of the diameter, above 0.
    image
        Width and height [pixels].
    against
        'exact' (media=exact in float64) or 'truth' (the quadrature estimator).
    progress
        Callback with the number done, the total and a description of the next step, or None.

    Returns
    -------
    tuple
        One entry for each size and optical depth, sizes first.

    Raises
    ------
    InputError
        For a size or an optical depth out of range, or another value of `against`.
    """
    if against not in ("exact", "truth"):
        raise InputError(f"against: got {against!r}, wanted exact or truth")
    for size in sizes:
        if not 0 < size < 1:
            raise InputError(f"size: got {size!r}, wanted a radius over the lamp's distance above 0 and below 1")
    for depth in optical_depths:
        if not 0 < depth < np.inf:
            raise InputError(f"optical depth: got {depth!r}, wanted a finite value above 0")
    pairs = [(size, depth) for size in sizes for depth in optical_depths]
    results = []
    for number, (size, depth) in enumerate(pairs):
        if progress:
            progress(number, len(pairs), f"size {size:g}, optical depth {depth:g}")
        results.append(_judged(size, depth, image, against))
    return tuple(results)


def sphere_in_clear_air(size: float, optical_depth: float, image: tuple[int, int]) -> dict[str, Any]:
    """Return a sphere of fog as high as the view, and a lamp at radius/size from its centre."""
    lamp = _LAMP / np.linalg.norm(_LAMP) * (_RADIUS / size)
    medium = {
        "type": "homogeneous",
        "sigma_t": 1.0,
        "scale": 0.5 * optical_depth / _RADIUS,
        "albedo": 0.83,
        "has_spectral_extinction": False,
    }
    return {
        "type": "scene",
        "sensor": camera((0.13, -5.3, 0.21), (0.0, 0.0, 0.0), fov=27.1, size=image, in_fog=False),
        "lamp": {"type": "point", "position": lamp.tolist(), "intensity": {"type": "rgb", "value": [3.1, 3.1, 3.1]}},
        "ball": {"type": "sphere", "radius": _RADIUS, "bsdf": {"type": "null"}, "interior": medium},
    }


def _judged(size: float, depth: float, image: tuple[int, int], against: str) -> ConstantDistance:
    loaded = mi.load_dict(sphere_in_clear_air(size, depth, image))
    scene = read_scene(loaded, "double")
    exact = truth_image(loaded).airlight if against == "truth" else _airlight(scene, "exact")
    paper = _airlight(scene, "paper")
    in_medium = exact[..., 1] > 0
    test, reference = paper[in_medium], exact[in_medium]
    scale = float(np.sum(test * reference) / np.sum(test * test))
    error = error_metrics(exact, paper, mask=in_medium)
    return ConstantDistance(
        size=size,
        optical_depth=depth,
        relative_rmse=error.relative_rmse,
        relative_bias=error.relative_bias,
        scale=scale,
        shape=error_metrics(exact, scale * paper, mask=in_medium).relative_rmse,
        polynomial=error_metrics(exact, _airlight(scene, "paper", "taylor"), mask=in_medium).relative_rmse,
        printed=error_metrics(exact, _airlight(scene, "printed"), mask=in_medium).relative_rmse,
    )


def _airlight(scene, media: str, kernel: str = "exact"):
    return render_frame(prepared(scene, configuration("shadow-planes", kernel, {"media": media}))).airlight
