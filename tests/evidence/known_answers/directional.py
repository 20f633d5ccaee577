# SPDX-License-Identifier: BSD-3-Clause
"""Laws that airlight of directional lights obeys exactly, and a box of fog whose answer is known in closed form.

With L = albedo sigma_t E p(c) / (4 pi) int V exp(-tau_camera - tau_leg) dx, summed over lights and media:

- L is linear in albedo and irradiance, and adds up over lights of all kinds.
- Lengths times k and sigma_t over k leave the exponent; sigma_t dx too: unlike that of a lamp, L stays as it is.
- Turning the whole scene changes nothing.
- **A box under vertical light.** The leg from a point of height z goes straight up to the lid at z_1. A ray that is in
  the box from (height z_0) on for the length l, and rises by w_z a metre, has tau = sigma_t (z_1 - z_0 + (1 - w_z) y)
  after y metres, so

      L = albedo E p(w_z) / (4 pi) exp(-sigma_t (z_1 - z_0)) (1 - exp(-sigma_t (1 - w_z) l)) / (1 - w_z).

- An occluder that encloses the scene leaves exactly nothing.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.scene.read import read_truth
from tests.evidence.certified.model import load_fog
from tests.evidence.known_answers.record import ESTIMATORS, EXACT, FLOAT32, KnownAnswer, largest_difference, layers

Array = NDArray[np.float64]
Scene = dict[str, Any]

_SIZE = 12  # pixels along each side
_G = 0.375
_BOX = np.array([0.125, 0.25, 1.0]), np.array([1.0, 0.75, 0.875])  # centre, half edges
_AWAY = [[0.48, 0.6, 0.64, 0.0], [-0.36, 0.8, -0.48, 0.0], [-0.8, 0.0, 0.6, 0.0], [0.0, 0.0, 0.0, 1.0]]  # a rotation


def directional_answers() -> list[KnownAnswer]:
    """Return all known answers, for each estimator as far as the law is exact for it."""
    answers = [
        law(estimator) for law in (albedo_linear, irradiance_linear, units, enclosed) for estimator in ESTIMATORS
    ]
    return [*answers, lights_add_up(), turned(), vertical_light()]


def base_scene() -> Scene:
    """Return a slab that shadows a box of fog under a sun, and a camera outside; matrices as of `fog_model`."""
    mist = {
        "type": "homogeneous",
        "sigma_t": {"type": "rgb", "value": [0.375, 0.5, 0.75]},
        "scale": 1.0,
        "albedo": {"type": "rgb", "value": [0.75, 0.5, 0.25]},
        "phase": {"type": "hg", "g": _G},
    }
    # Looking along +y from before the box: columns left, up, forward, position.
    camera = [[-1.0, 0, 0, 0.25], [0, 0, 1, -3.5], [0, 1, 0, 1.125], [0, 0, 0, 1]]
    return {
        "type": "scene",
        "sensor": {
            "type": "perspective",
            "fov": 40.0,
            "fov_axis": "x",
            "near_clip": 0.0001,
            "to_world": {"matrix": camera},
            "film": {"type": "hdrfilm", "width": _SIZE, "height": _SIZE, "rfilter": {"type": "box"}},
        },
        "sun": {"type": "directional", "to_world": {"matrix": _down(_AWAY)}, "irradiance": _rgb(8.0, 6.0, 4.0)},
        "body": _cube(*_BOX) | {"bsdf": {"type": "null"}, "interior": mist},
        "occluder": _cube([1.0, -0.5, 2.25], [0.5, 0.375, 0.0625]) | {"bsdf": {"type": "diffuse"}},
    }


def _rgb(*values: float) -> Scene:
    return {"type": "rgb", "value": list(values)}


def _cube(centre, half_edges) -> Scene:
    matrix = np.diag([*(float(value) for value in half_edges), 1.0])
    matrix[:3, 3] = centre
    return {"type": "cube", "to_world": {"matrix": matrix.tolist()}}


def _down(rotation: list[list[float]]) -> list[list[float]]:
    """Turn the third axis of a rotation downwards, if it is not."""
    matrix = np.array(rotation)
    return (matrix if matrix[2, 2] < 0 else matrix @ np.diag([1.0, -1.0, -1.0, 1.0])).tolist()


def _lamp() -> Scene:
    return {"type": "point", "position": [0.5, -0.25, 2.5], "intensity": _rgb(5.0, 6.0, 7.0)}


def albedo_linear(estimator: str = "quadrature") -> KnownAnswer:
    """Halve the albedo."""
    scene, half = base_scene(), base_scene()
    half["body"]["interior"]["albedo"] = _rgb(0.375, 0.25, 0.125)
    return _compared("directional airlight is linear in the albedo", estimator, scene, half, factor=0.5)


def irradiance_linear(estimator: str = "quadrature") -> KnownAnswer:
    """Multiply the irradiance by 4."""
    scene, more = base_scene(), base_scene()
    more["sun"]["irradiance"] = _rgb(32.0, 24.0, 16.0)
    return _compared("directional airlight is linear in the irradiance", estimator, scene, more, factor=4.0)


def units(estimator: str = "quadrature") -> KnownAnswer:
    """Measure lengths in units a quarter as long; the light is as strong as before."""
    k = 4.0
    scene, scaled = base_scene(), base_scene()
    for name in ("body", "occluder"):
        matrix = np.array(scaled[name]["to_world"]["matrix"])
        matrix[:3] *= k
        scaled[name]["to_world"] = {"matrix": matrix.tolist()}
    camera = np.array(scaled["sensor"]["to_world"]["matrix"])
    camera[:3, 3] *= k
    scaled["sensor"]["to_world"] = {"matrix": camera.tolist()}
    scaled["body"]["interior"]["scale"] = 1 / k
    return _compared("directional airlight has no length", estimator, scene, scaled)


def lights_add_up() -> KnownAnswer:
    """Add the images under the sun and under a lamp."""
    scene = base_scene()
    both = _airlight(scene | {"lamp": _lamp()}, "quadrature")
    lamp = {name: entry for name, entry in scene.items() if name != "sun"} | {"lamp": _lamp()}
    parts = _airlight(scene, "quadrature") + _airlight(lamp, "quadrature")
    reason = "the same sums in another order"
    return KnownAnswer("airlight of sun and lamp adds up", "quadrature", largest_difference(both, parts), 1e-13, reason)


def turned() -> KnownAnswer:
    """Turn the scene by a third of a turn about (1, 1, 1): the axes change places, and no number is rounded."""
    turn = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

    def mapped(value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        if set(value) == {"matrix"}:
            return {"matrix": (turn @ np.array(value["matrix"])).tolist()}
        return {name: mapped(entry) for name, entry in value.items()}

    scene = base_scene()
    return _compared("a turn of sun and scene changes nothing", "quadrature", scene, mapped(scene))


def vertical_light() -> KnownAnswer:
    """Hold every pixel against the closed form of a box under vertical light."""
    down = [[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]
    scene = {name: entry for name, entry in base_scene().items() if name != "occluder"}
    scene["sun"] = scene["sun"] | {"to_world": {"matrix": down}}
    truth = read_truth(load_fog(scene))
    (medium,), (light,) = truth.media, truth.directional
    with np.errstate(divide="ignore"):
        lower, upper = ((_BOX[0] + sign * _BOX[1] - truth.origin) / truth.direction for sign in (-1, 1))
    low, high = np.minimum(lower, upper).max(axis=1), np.maximum(lower, upper).min(axis=1)
    length = np.maximum(high - low, 0.0)[:, None]
    rise = truth.direction[:, 2:]
    above = _BOX[0][2] + _BOX[1][2] - truth.origin[2] - low[:, None] * rise
    p = (1 - _G**2) / (1 + _G**2 - 2 * _G * rise) ** 1.5
    integral = np.exp(-medium.sigma_t * above) * -np.expm1(-medium.sigma_t * (1 - rise) * length) / (1 - rise)
    expected = medium.albedo * light.irradiance * p / (4 * math.pi) * np.where(length > 0, integral, 0.0)
    airlight = layers(truth, "quadrature")[0]
    difference = largest_difference(airlight, expected)
    return KnownAnswer("a box of fog under vertical light", "quadrature", difference, 1e-13, "float64 rounding")


def enclosed(estimator: str = "quadrature") -> KnownAnswer:
    """Put everything into an opaque box."""
    scene = base_scene()
    shell = _cube([0.0, 0.0, 0.0], [16.0, 16.0, 16.0]) | {"bsdf": {"type": "diffuse"}}
    most = float(np.abs(layers(read_truth(load_fog(scene | {"shell": shell})), estimator)).max())
    return KnownAnswer("no sun in a closed box", estimator, most, 0.0, "exactly zero, surfaces included")


def _compared(name: str, estimator: str, scene: Scene, changed: Scene, *, factor: float = 1.0) -> KnownAnswer:
    difference = largest_difference(_airlight(changed, estimator), factor * _airlight(scene, estimator))
    return KnownAnswer(name, estimator, difference, *(EXACT if estimator == "quadrature" else FLOAT32))


def _airlight(scene: Scene, estimator: str) -> Array:
    return layers(read_truth(load_fog(scene)), estimator)[0]
