# SPDX-License-Identifier: BSD-3-Clause
"""What to set in renderers that were tried, in their own words and with the numbers of a scene.

docs/examples has a script for each that does the same.
"""

import math
from typing import Any

_CYCLES = (
    "camera: Sensor Fit Auto, Shift 0, Clip Start 1e-6 m, as its own 0.1 m takes away the medium before it; it "
    "looks along its -z, y up; no depth of field",
    "axes and lengths as here: right-handed, one unit is a metre, Unit Scale 1; its glTF importer turns y up to z up",
    "Cycles, all `Max Bounces` 0 but Transparent 1024, as they count from the first scattering on; `Clamp` 0, light "
    "threshold 0, no denoiser, no adaptive sampling, Film Exposure 1, not transparent; the World without Background",
    "Pixel filter Box; write 32-bit EXR, or multi-layer with the pass Volume Direct, which is the airlight",
    "View Transform Raw, Look None, Exposure 0, Gamma 1: an EXR is linear whatever these say, a PNG is not",
    "surfaces: Diffuse BSDF of the reflectance, Roughness 0; Shadow Terminator offsets 0",
    "`--json` has all of this as names and values of Blender's Python, `properties`",
)
_VARYING = "media: height fog and grids were not tried"
_LUXCORE = (
    "`path.pathdepth.total` 1, `path.clamping.variance.maxvalue` 0, `film.filter.type` BOX of width 0.5, output RGB",
    "its images are a pixel too low: move `scene.camera.screenwindow` up by one",
)


def recipes(described: dict[str, Any]) -> dict[str, list[str]]:
    """Return what to set by the name of the renderer, from what `describe_scene` found."""
    every = [medium for medium in (described["medium"], *described["bounded_media"]) if medium is not None]
    media = [medium for medium in every if "sigma_s" in medium]
    phases = {medium["phase"]["name"] for medium in media}
    lights = described["lights"]
    cycles = [_cycles_light(light, _name(number, lights)) for number, light in enumerate(lights)]
    cycles += [_cycles_media(phases)] if media else [_VARYING] if every else []
    luxcore = [_luxcore_light(light, _name(number, lights)) for number, light in enumerate(lights)]
    luxcore += [_luxcore_media(phases)] if media else [_VARYING] if every else []
    longer = (
        "horizontal" if described["camera"]["fov_horizontal"] >= described["camera"]["fov_vertical"] else "vertical"
    )
    angle = f"the field of view is the {longer} one, {described['camera'][f'fov_{longer}']:.7g} degrees"
    return {"Cycles": [*cycles, angle, *_CYCLES], "LuxCore": [*luxcore, angle, *_LUXCORE]}


def _name(number: int, lights: list[Any]) -> str:
    return "light" if len(lights) == 1 else f"light {number + 1}"


def _cycles_light(light: dict[str, Any], name: str) -> str:
    if light["kind"] == "area":
        return _cycles_area(light, name)
    if light["kind"] == "directional":
        brightest = max(light["irradiance"])
        return f"{name}: Sun of strength {brightest:.7g}, colour {_colour(light['irradiance'], brightest)}, angle 0"
    brightest = max(light["intensity"])
    colour = f"power {4 * math.pi * brightest:.7g} W, colour {_colour(light['intensity'], brightest)}, radius 0"
    if light["kind"] == "point":
        return f"{name}: Point, {colour}, no soft falloff"
    size = f"spot size {2 * light['cutoff_angle']:.7g} degrees, which is the whole angle"
    soft = light["beam_angle"] < light["cutoff_angle"]
    blend = "its blend is another function of the angle: this edge cannot be made" if soft else "blend 0"
    return f"{name}: Spot, {colour}, no soft falloff, {size}, {blend}"


def _cycles_area(light: dict[str, Any], name: str) -> str:
    """Return how to make a light with extent: Cycles' own lights are watts, of a flat one 4/pi times its power."""
    brightest = max(light["radiance"])
    colour = f"colour {_colour(light['radiance'], brightest)}"
    if light["shape"] == "sphere":
        power = math.pi * light["area"] * brightest
        return (
            f"{name}: Point of radius {light['radius']:.7g}, power {power:.7g} W, {colour}, no soft falloff (not tried)"
        )
    sides = light.get("sides", [2 * light.get("radius", 0.0)] * 2)
    shape = "Rectangle" if light["shape"] == "rectangle" else "Disk"
    size = f"{sides[0]:.7g} x {sides[1]:.7g} m, spread 180 degrees"
    return f"{name}: Area, {shape} of {size}, power {4 * light['area'] * brightest:.7g} W, {colour} (not tried)"


def _cycles_media(phases: set[str]) -> str:
    line = "media: Volume Coefficients with sigma_s and sigma_a as Scatter and Absorption, on the world or the body, "
    line += "or Volume Scatter and Volume Absorption, both of Density sigma_t and Color albedo; Anisotropy is g"
    kinds = {"hg": "Henyey-Greenstein", "isotropic": "Henyey-Greenstein of anisotropy 0", "rayleigh": "Rayleigh"}
    named = [kinds[name] for name in sorted(phases) if name in kinds]
    line += f"; phase {', '.join(named)}" if named else ""
    return line + ("; it has no tabulated phase function" if "tabulated" in phases else "")


def _luxcore_light(light: dict[str, Any], name: str) -> str:
    if light["kind"] == "area":
        radiance = _plain(light["radiance"])
        return f"{name}: a mesh of `emission` {radiance}, `emission.theta` 90, no power or efficiency (not tried)"
    if light["kind"] == "directional":
        return f"{name}: `sharpdistant`, colour {_plain(light['irradiance'])} (not tried)"
    colour = f"colour 4 pi I = {_plain([4 * math.pi * value for value in light['intensity']])}, no power or efficiency"
    if light["kind"] == "point":
        return f"{name}: `point`, {colour}"
    return f"{name}: its `spot` is 1/cos(angle) brighter off the axis: this light cannot be made"


def _luxcore_media(phases: set[str]) -> str:
    line = "media: `homogeneous`, `scattering` sigma_s, `absorption` sigma_a"
    other = sorted(phases - {"isotropic"})
    return line + (f"; its phase function is Schlick's: no {', '.join(other)}" if other else ", `asymmetry` 0")


def _colour(values: list[float], brightest: float) -> str:
    return _plain([value / brightest for value in values] if brightest > 0 else [1.0, 1.0, 1.0])


def _plain(values: list[float]) -> str:
    return f"({', '.join(f'{value:.7g}' for value in values)})"
