# SPDX-License-Identifier: BSD-3-Clause
"""The height fog of engines as layers: what their parameters mean in metres, and
what of it is not physical.

**Unreal.** With k = FogHeightFalloff/1000 and D = FogDensity/1000 per cm the density is D 2^(-k
(z - z_0)). Its line integral, D (1 - 2^-F)/F with F = k times the rise, lacks 1/ln 2, and the
transmittance is 2^-integral, which puts in one ln 2 more: the extinction is (ln 2)^2 D, that is
0.048045 FogDensity per metre, and H = 1/(k ln 2), 14.427 m over FogHeightFalloff. The volumetric
fog (and the path tracer) has 1/2 for (ln 2)^2: 0.05 FogDensity ExtinctionScale per metre, 4.07 %
denser.

**Flax.** As Unreal, with one layer: 0.048045 FogDensity per metre in its analytic fog. The volumetric
fog has 0.24 for (ln 2)^2, half of it: 0.024 FogDensity ExtinctionScale per metre.

**Unity HDRP.** The extinction is 1/meanFreePath up to baseHeight and falls to a thousandth at
maximumHeight: H = (maximumHeight - baseHeight)/ln 1000, the difference being 0.01 m at least.

**PlayCanvas.** `density` up to `heightBase`, falling by exp(-heightFalloff (z - heightBase)) above
it; everywhere where heightFalloff is 0.

Read in shader text of Unreal as copied in public repositories (4.22 and later), in HDRP's Fog.cs
and VolumeRendering.hlsl, in the shaders of PlayCanvas 2.23.3, and in Flax's VolumetricFog.shader.
"""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

LN2 = math.log(2.0)
#: of a FogDensity, which is by 1000 per cm [1/m]
_PER_METRE = {
    "unreal": 0.1 * LN2**2,
    "unreal-volumetric": 0.1 * 0.5,
    "flax": 0.1 * LN2**2,
    "flax-volumetric": 0.1 * 0.24,
}


Layer = tuple[float, float, float]  # extinction [1/m], base [m], scale height [m]


@dataclass(frozen=True)
class EngineFog:
    """The fog that an engine's parameters stand for."""

    layers: tuple[Layer, ...]
    clamped: bool  #: whether layers are constant below their bases
    constant: float = 0.0  #: extinction at all heights [1/m]


#: see the file
ENGINES = tomllib.loads(Path(__file__).with_name("engine_fog.toml").read_text(encoding="utf-8"))


def fog_of_engine(engine: str, given: Mapping[str, float]) -> EngineFog:
    """Return the fog that an engine's parameters stand for."""
    if engine not in ENGINES:
        raise ValueError(f"heightfog has engine = {engine}; expected one of {', '.join(ENGINES)}")
    values = {
        name: given.get(name, default) for name, default in ENGINES[engine]["parameters"].items()
    }
    # "needed" stands in the table in place of a default, for parameters that an engine has no
    # usable default for.
    missing = [name for name, value in values.items() if value == "needed"]
    if missing:
        raise ValueError(
            f"heightfog of engine {engine} has no {missing[0]}; expected {', '.join(values)}"
        )
    number = {name: float(value) for name, value in values.items()}
    if engine == "hdrp":
        if not number["meanFreePath"] > 0:
            raise ValueError(
                f"heightfog has meanFreePath = {number['meanFreePath']:g}; expected a length above "
                "0 m"
            )
        # HDRP keeps its heights 0.01 m apart at least
        rise = max(number["maximumHeight"] - number["baseHeight"], 0.01)
        # exp(-rise/H) = 1/1000 at the maximum height
        layer = 1 / number["meanFreePath"], number["baseHeight"], rise / math.log(1000.0)
        return EngineFog((layer,), _is_clamped(engine))
    if engine == "playcanvas":
        density, falloff = number["density"], number["heightFalloff"]
        if falloff == 0:
            return EngineFog((), _is_clamped(engine), density)
        scale = 1 / _above_zero(number, "heightFalloff")
        return EngineFog(((density, number["heightBase"], scale),), _is_clamped(engine))
    # Unreal's own unit, and Flax' (see the module).
    factor = _PER_METRE[engine] * number.get("ExtinctionScale", 1.0)
    base, layers = number["FogHeight"], []
    for prefix, offset in (("", 0.0), ("Second", number.get("SecondFogHeightOffset", 0.0))):
        if number.get(f"{prefix}FogDensity"):
            # H = 1/(k ln 2) with k = FogHeightFalloff/1000 per cm, which is FogHeightFalloff/10 per
            # metre. A density of 0 is Unreal's way to say that there is no second layer.
            scale = 10 / (_above_zero(number, f"{prefix}FogHeightFalloff") * LN2)
            layers.append((factor * number[f"{prefix}FogDensity"], base + offset, scale))
    return EngineFog(tuple(layers), _is_clamped(engine))


def parameters_of(
    engine: str, layers: Sequence[Layer], *, clamped: bool, constant: float
) -> dict[str, float] | str:
    """Return an engine's parameters for layers, or in words why it has none."""
    if not layers and constant and engine == "playcanvas":
        return {"density": constant, "heightBase": 0.0, "heightFalloff": 0.0}
    if not layers:
        return "it has no fog without a layer"
    if constant:
        return "it has no constant part beside a layer"
    # HDRP and PlayCanvas are constant below their bases, the fog of Unreal grows on: layers of the
    # other kind have no parameters.
    if clamped != _is_clamped(engine):
        return f"its layers {'go on' if clamped else 'are constant'} below their bases"
    if len(layers) > 1 + ("SecondFogDensity" in ENGINES[engine]["parameters"]):
        return "it has one layer"
    sigma_t, base, scale = layers[0]
    if engine == "hdrp":
        return {
            "meanFreePath": 1 / sigma_t,
            "baseHeight": base,
            "maximumHeight": base + scale * math.log(1000.0),
        }
    if engine == "playcanvas":
        return {"density": sigma_t, "heightBase": base, "heightFalloff": 1 / scale}
    factor = _PER_METRE[engine]
    numbers = {
        "FogDensity": sigma_t / factor,
        "FogHeightFalloff": 10 / (scale * LN2),
        "FogHeight": base,
    }
    # The second layer of Unreal has its height relative to the first.
    if len(layers) == 2:
        sigma_t, other, scale = layers[1]
        numbers["SecondFogDensity"] = sigma_t / factor
        numbers |= {
            "SecondFogHeightFalloff": 10 / (scale * LN2),
            "SecondFogHeightOffset": other - base,
        }
    return numbers


def _is_clamped(engine: str) -> bool:
    return bool(ENGINES[engine].get("clamped", False))


def _above_zero(number: Mapping[str, float], name: str) -> float:
    if not number[name] > 0:
        raise ValueError(f"heightfog has {name} = {number[name]:g}; expected a number above 0")
    return number[name]
