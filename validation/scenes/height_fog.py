# SPDX-License-Identifier: BSD-3-Clause
"""`heightfog`, a volume of Mitsuba whose density depends on height alone: layers of
engines' exponential height fog.

    <medium type="heterogeneous" id="fog">
        <volume type="heightfog" name="sigma_t">
            <float name="sigma_1" value="0.05"/>  <float name="z_1" value="0"/>  <float name="H_1" value="4"/>
            <transform name="to_world"> <scale x="400" y="400" z="60"/> <translate x="-200" y="-200"/> </transform>
        </volume>
        <float name="albedo" value="0.9"/>
    </medium>

The extinction at a height z is, times the medium's `scale`,

    sigma_0 + sigma_1 exp(-(z - z_1)/H_1) + sigma_2 exp(-(z - z_2)/H_2)     [1/m],

with max(z - z_i, 0) for z - z_i if `clamped` is true. Numbers that are not given are 0. `to_world`
takes the unit cube to a box: its third axis is up, its lower and upper end are the floor and the
cap of the fog, beyond which there is nothing. The fog has no sides: Mitsuba gets a box that is a
thousand times as wide as it is high at least.

In place of these numbers it takes an engine's parameters, with `<string name="engine"
value="unreal"/>` (`validation.scenes.engine_fog`).

Mitsuba knows the volume once a scene was loaded, or `register_height_fog`
was called for its variant.
"""

from __future__ import annotations

import math
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.reference.scene.transforms import matrix_of
from airlight.validation.arrays import Array
from airlight.validation.scenes.engine_fog import ENGINES, fog_of_engine

NUMBERS = ("sigma_0", "sigma_1", "z_1", "H_1", "sigma_2", "z_2", "H_2")


def register_height_fog() -> None:
    """Let Mitsuba's current variant know the volume `heightfog`."""
    _register(mi.variant())


@cache
def _register(variant: str) -> None:
    class HeightFog(mi.Volume):
        """Exponential layers over a floor and under a cap."""

        def __init__(self, props):
            numbers, self._clamped = _layers(props)
            # Mitsuba samples distances within the box of `to_world`: the wide box replaces the one
            # of the file, which gives floor and cap only.
            floor, cap, up, box = _box(props)
            props["to_world"] = mi.ScalarAffineTransform4d(box)
            mi.Volume.__init__(self, props)
            self._numbers = {name: mi.Float(value) for name, value in numbers.items()}
            self._ends = {"floor": mi.Float(floor), "cap": mi.Float(cap)}
            self._up = mi.Vector3f(*up)
            # Opaque numbers are inputs of compiled kernels: a change of the fog compiles nothing
            # again.
            dr.make_opaque(self._numbers, self._ends, self._up)
            self.parameters_changed()

        def parameters_changed(self, keys=()):
            numbers = {name: float(value[0]) for name, value in self._numbers.items()}
            # Delta tracking needs a bound that no evaluation in float32 exceeds.
            above = 1 + 1e-5  # what float32 may add to the largest density
            self._largest = above * _checked_largest(
                numbers, self._clamped, float(self._ends["floor"][0])
            )
            self._layers = [i for i in "12" if numbers[f"sigma_{i}"] > 0]

        def eval_1(self, it, active=True):
            # The axis up is an axis of coordinates with a sign, so the dot product is the height
            # itself, exactly.
            z = dr.dot(mi.Vector3f(it.p), self._up)
            total = self._numbers["sigma_0"]
            for i in self._layers:
                above = z - self._numbers[f"z_{i}"]
                above = dr.maximum(above, 0) if self._clamped else above
                total = total + self._numbers[f"sigma_{i}"] * dr.exp(
                    -above / self._numbers[f"H_{i}"]
                )
            return dr.select((z >= self._ends["floor"]) & (z <= self._ends["cap"]), total, 0)

        def eval(self, it, active=True):
            return mi.UnpolarizedSpectrum(self.eval_1(it, active))

        def max(self):
            return self._largest

        def traverse(self, callback):
            for name, value in (self._numbers | self._ends).items():
                callback.put(name, value, mi.ParamFlags.NonDifferentiable)
            callback.put("up", self._up, mi.ParamFlags.NonDifferentiable)
            callback.put("clamped", mi.Float(self._clamped), mi.ParamFlags.NonDifferentiable)

        def to_string(self):
            numbers = ", ".join(
                f"{name} = {value[0]!r}" for name, value in (self._numbers | self._ends).items()
            )
            up = [float(each[0]) for each in self._up]
            return f"HeightFog[{numbers}, clamped = {self._clamped}, up = {up}]"

    mi.register_texture("heightfog", HeightFog)


def _layers(props: mi.Properties) -> tuple[dict[str, float], bool]:
    """Return the numbers of the layers, and whether they are clamped, from numbers or
    from an engine's parameters.
    """
    if "engine" not in props:
        numbers = {name: float(props.get(name, 0.0)) for name in NUMBERS}
        return numbers, bool(props.get("clamped", False))
    engine = str(props["engine"])
    # A parameter that the engine has but the file does not give keeps the engine's default.
    names = ENGINES[engine]["parameters"] if engine in ENGINES else ()
    fog = fog_of_engine(engine, {name: float(props[name]) for name in names if name in props})
    numbers = dict.fromkeys(NUMBERS, 0.0) | {"sigma_0": fog.constant}
    for i, layer in enumerate(fog.layers, 1):
        numbers |= dict(zip((f"sigma_{i}", f"z_{i}", f"H_{i}"), layer, strict=True))
    return numbers, fog.clamped


def _box(props: mi.Properties) -> tuple[float, float, list[float], Array]:
    """Return floor and cap [m], the unit vector up, (3,), and the transform of the box that
    Mitsuba gets, (4, 4) [m].
    """
    if "to_world" not in props:
        raise ValueError(
            "heightfog has no to_world; expected the box of the fog: the unit cube from its floor "
            "to its cap"
        )
    matrix = matrix_of(props["to_world"])
    height = float(np.linalg.norm(matrix[:3, 2]))
    if not (np.isfinite(matrix).all() and height > 0):
        raise ValueError(
            "heightfog has a to_world without a height; expected its cap above its floor"
        )
    up = matrix[:3, 2] / height
    # The third column must point along an axis of coordinates, and the other two have no part along
    # it, to 1e-6: the density depends on one coordinate only.
    axis = int(np.argmax(np.abs(up)))
    level = np.abs(matrix[axis, :2]).max() <= 1e-6 * np.abs(matrix[axis, 2])
    if abs(up[axis]) < 1 - 1e-6 or not level:
        raise ValueError(
            "heightfog has a to_world that is tilted; expected its third axis along x, y or z, the "
            "others level"
        )
    # Without the rounding of the file's matrix from here on.
    up = np.sign(up) * (np.arange(3) == axis)
    floor = float(up @ matrix[:3, 3])
    middle = matrix[:3, 3] + 0.5 * (matrix[:3, 0] + matrix[:3, 1])
    # The fog has no sides: half the width is a thousand heights at least.
    half = np.maximum(0.5 * (np.abs(matrix[:3, 0]) + np.abs(matrix[:3, 1])), 1000.0 * height)
    # Along the axis up the box goes from the lower to the upper end, whichever sign the axis has;
    # across it the box is centred on the file's own.
    low = np.where(up != 0, np.minimum(matrix[:3, 3], matrix[:3, 3] + matrix[:3, 2]), middle - half)
    size = np.where(up != 0, height, 2 * half)
    box = np.diag([*size, 1.0])
    box[:3, 3] = low
    return floor, floor + height, [float(each) for each in up], box


def _checked_largest(numbers: dict[str, float], clamped: bool, floor: float) -> float:
    """Return the largest density, that at the floor [1/m]; refuse numbers that make no fog."""
    total = numbers["sigma_0"]
    for i in "12":
        sigma_t, base, scale = (numbers[f"{name}_{i}"] for name in ("sigma", "z", "H"))
        if sigma_t and not scale > 0:
            raise ValueError(
                f"heightfog has sigma_{i} = {sigma_t:g} and H_{i} = {scale:g}; expected a scale "
                "height above 0"
            )
        if sigma_t:
            # All layers fall with height, so the density is largest at the floor; clamped layers
            # are constant below their bases. More than 700 scale heights below the base exp
            # overflows; the sum is refused at the end.
            above = (max(floor - base, 0.0) if clamped else floor - base) / scale
            total += sigma_t * (math.exp(-above) if above > -700 else math.inf)
    # Written with `not >= 0` so that NaN is refused too.
    negative = [name for name in ("sigma_0", "sigma_1", "sigma_2") if not numbers[name] >= 0]
    if negative:
        raise ValueError(
            f"heightfog has {negative[0]} = {numbers[negative[0]]:g}; expected an extinction of 0 "
            "or more"
        )
    if not total < 1e9:
        raise ValueError(
            f"heightfog has the extinction {total:g} per m at its floor, {floor:g} m: nothing "
            "bounds the density that "
            "Mitsuba samples; raise the floor, the lower end of the box of to_world"
        )
    return total
