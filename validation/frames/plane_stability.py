# SPDX-License-Identifier: BSD-3-Clause
"""Cases in which sums over many shadow planes lose digits: deep stacks of slats, a strong light nearby, a dim one.

The airlight of a ray that crosses shadow planes is sum_i Gamma(b_i) - Gamma(a_i). If each Gamma has a relative rounding
error eps, the sum has an error of about eps sum_i Gamma. That is many times the sum itself where slats let little light
through, or where a strong light close to the camera makes Gamma large before the first shadow. The integrals J(a_i,
b_i) of the lit segments are positive, so their sum keeps the digits of its terms. `sum=segments` adds these integrals,
`sum=gamma` adds the differences, and `order=none` and `order=paper` add Gamma plane by plane. All are compared with the
quadrature truth, whose lit intervals come from exact geometry.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from reference.quadrature.image import quadrature_image
from reference.scene.read import read_truth
from validation.configurations.methods import configuration, prepared
from validation.metrics.errors import FLOOR
from validation.scenes.parts import Mesh, camera, fog, joined, mitsuba_mesh, placed, point_light, rotation
from validation.scenes.solids import box

Progress = Callable[[int, int, str], None]

SIZE = (64, 48)  #: of the images [pixels]
WITHIN = 1e-4  #: largest error of `sum=segments`, relative to the true value of the pixel
SUMS = ("segments", "gamma")
PRECISIONS = ("single", "double")


@dataclass(frozen=True)
class PlaneStability:
    """The errors of one image of a hard case."""

    case: str
    sum: str  #: 'segments', 'gamma', or 'planes': float32 against float64 of Gamma plane by plane
    precision: str
    pixels: int
    median: float  #: of |error| / true value
    p99: float
    max: float
    beyond: int  #: number of values (pixels and channels) that miss the truth by more than `WITHIN`
    negative: int  #: number of values below -1e-5 of the mean
    nonfinite: int


def hard_cases() -> dict[str, Callable[[], dict[str, Any]]]:
    """Return the scenes by name, as functions that return a dictionary for `mi.load_dict`."""
    return {
        "deep stack": lambda: _slats(0.37, lamp=(0.2, 1.61, 1.07), power=17.0),
        "lantern close by": _lantern,
        "thick fog": lambda: _slats(2.9, lamp=(0.2, 1.61, 1.07), power=17.0),
        "dim light behind": lambda: _slats(0.37, lamp=(-0.43, 23.0, 1.9), power=0.013),
    }


def plane_stability(*, size: tuple[int, int] = SIZE, progress: Progress | None = None) -> list[PlaneStability]:
    """Render every hard case with both sums in both precisions, and compare with the truth.

    Parameters
    ----------
    size
        Of the images [pixels].
    progress
        Callback with the number done, the total and a description, before every case, or None.
    """
    results = []
    cases = hard_cases()
    for number, (name, build) in enumerate(cases.items()):
        if progress is not None:
            progress(number, len(cases), f"shadow planes: {name}")
        description = build()
        film = description["sensor"]["film"] | {"width": size[0], "height": size[1]}
        description["sensor"] = description["sensor"] | {"film": film}
        scene = mi.load_dict(description)
        truth = quadrature_image(read_truth(scene), edges="geometry").airlight
        for precision in PRECISIONS:
            for terms in SUMS:
                image = _airlight(scene, precision, sum=terms)
                results.append(_compared((name, terms, precision), image, truth, scale=truth))
        single, double = (_airlight(scene, precision, order="none") for precision in PRECISIONS)
        results.append(_compared((name, "planes", "single"), single, double, scale=truth))
    return results


def broken(results: list[PlaneStability]) -> list[str]:
    """Return a sentence for each limit that the default, `sum=segments`, does not keep."""
    words = []
    for result in results:
        if result.sum != "segments":
            continue
        counts = {
            f"values beyond {WITHIN:g}": result.beyond,
            "negative": result.negative,
            "NaN or infinite": result.nonfinite,
        }
        words += [f"{result.case}, {result.precision}: {count} {what}" for what, count in counts.items() if count]
    return words


def _airlight(scene, precision: str, **parameters):
    renderer = prepared(read_scene(scene, precision), configuration("shadow-planes", "exact", parameters))
    return np.asarray(render_frame(renderer).airlight, dtype=np.float64)


def _compared(what: tuple[str, str, str], image, expected, *, scale) -> PlaneStability:
    """Return the errors of an image against another, relative to the true values."""
    finite = np.isfinite(image)
    mean = scale.mean()
    error = (np.abs(image - expected) / np.maximum(scale, FLOOR * mean))[finite]
    return PlaneStability(
        *what,
        pixels=image.shape[0] * image.shape[1],
        median=float(np.median(error)),
        p99=float(np.quantile(error, 0.99)),
        max=float(error.max()),
        beyond=int(np.sum(error > WITHIN)),
        negative=int(np.sum(image < -1e-5 * mean)),
        nonfinite=int(np.sum(~finite)),
    )


def _lantern() -> dict[str, Any]:
    """Return a lantern of nine blades with narrow gaps a metre from the camera: thin beams of a strong light."""
    centre = np.array([0.31, -3.07, 0.79])
    parts = [placed(box((0.41, 0.37, 0.013)), (centre + np.array([0, 0, z])).tolist()) for z in (-0.23, 0.23)]
    for number in range(9):
        turn = rotation((0.0, 0.0, 1.0), 40.0 * number + 7.0)
        blade, faces = box((0.011, 0.0797, 0.47))
        parts.append(placed((blade + np.array([0.117, 0, 0]), faces), centre.tolist(), turn))
    return _scene(0.37, centre.tolist(), 4100.0, joined(parts))


def _slats(sigma_t: float, *, lamp: tuple[float, float, float], power: float) -> dict[str, Any]:
    """Return forty-one slats in fog, one behind the other, alternately upright and horizontal."""
    slats = []
    for number in range(41):
        upright = number % 2
        slat = box((0.023, 0.011, 1.7) if upright else (1.9, 0.011, 0.023))
        step = 0.037 * (number % 13) - 0.21
        place = (step, -1.13 + 0.051 * number, 0.93) if upright else (0.07, -1.13 + 0.051 * number, 0.93 + step)
        slats.append(placed(slat, place))
    return _scene(sigma_t, lamp, power, joined(slats))


def _scene(sigma_t: float, lamp, power: float, casters: Mesh) -> dict[str, Any]:
    """Return casters in fog before a camera that looks along +y."""
    return {
        "type": "scene",
        "fog": fog(sigma_t, (0.9, 0.8, 0.7)),
        "sensor": camera((0.03, -4.1, 0.83), (0.05, 0.0, 0.89), fov=37.0, size=SIZE),
        "lamp": point_light(lamp, [power] * 3),
        "casters": mitsuba_mesh("casters", casters, (0.5, 0.4, 0.3)),
    }
