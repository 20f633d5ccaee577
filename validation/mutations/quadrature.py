# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the physics in the quadrature: the slips that its derivation and its program invite."""

from validation.mutations.record import Mutation

_SUMS = "reference.quadrature.unbounded"
_PANELS = "analytic.panels"
_PHASE = "analytic.phase"
_CONE = "reference.visibility.spot_cone"
_SURFACE = "reference.quadrature.surface"
_GEOMETRY = "reference.visibility.triangles"
_FACTOR = "factor = medium.albedo * medium.sigma_t * light.intensity / (4 * np.pi)"
_START = "x0 = np.maximum(foot + height * np.tan(low), 0.0)"
_EXPONENT = """    up_rate = 0.5 * (1 + s) * sigma_t * height
    exponent = up_rate[:, None] * e
    exponent += (sigma_t * foot)[:, None]
    if s != 1:
        exponent -= (0.5 * (1 - s) * sigma_t * height)[:, None] * inverse
"""
_HG = "g = self.g\n            base"
_END = "            np.maximum(x1, x0),\n"


def _quadrature(name: str, meaning: str, module: str, old: str, new: str, remark: str = "") -> Mutation:
    return Mutation(name, meaning, "quadrature", module, old, new, remark)


_CONSTANTS = (
    _quadrature(
        "no-four-pi",
        "the 1/(4 pi) of the phase function dropped",
        _SUMS,
        _FACTOR,
        _FACTOR.replace(" / (4 * np.pi)", ""),
    ),
    _quadrature("four-pi-twice", "1/(4 pi) applied twice", _SUMS, _FACTOR, _FACTOR.replace("np.pi)", "np.pi) ** 2")),
    _quadrature(
        "extinction-for-scattering",
        "sigma_t in the place of sigma_s: the albedo dropped",
        _SUMS,
        _FACTOR,
        _FACTOR.replace("medium.albedo * ", ""),
    ),
    _quadrature("albedo-squared", "the albedo applied twice", _SUMS, _FACTOR, _FACTOR.replace("albedo", "albedo**2")),
    _quadrature(
        "one-extinction",
        "the extinction of the first channel taken for all three",
        _SUMS,
        "if channel and sigma_t == medium.sigma_t[0]:",
        "if channel:",
    ),
    _quadrature(
        "one-per-cent",
        "everything scattered in the medium 1 % too bright",
        _SUMS,
        _FACTOR,
        f"{_FACTOR} * 1.01",
    ),
    _quadrature(
        "three-per-mille",
        "everything scattered in the medium 0.3 % too bright",
        _SUMS,
        _FACTOR,
        f"{_FACTOR} * 1.003",
    ),
    _quadrature(
        "one-per-mille",
        "everything scattered in the medium 0.1 % too bright",
        _SUMS,
        _FACTOR,
        f"{_FACTOR} * 1.001",
    ),
    _quadrature(
        "one-in-ten-thousand",
        "everything scattered in the medium 0.01 % too bright",
        _SUMS,
        _FACTOR,
        f"{_FACTOR} * 1.0001",
        "a bias inside the margin counts as agreement",
    ),
)

_ATTENUATION = (
    _quadrature(
        "bright-shadow-leg",
        "the leg from the light not attenuated",
        _PANELS,
        "    s = integrand.shadow_scale\n",
        "    s = 0.0\n",
    ),
    _quadrature(
        "bright-camera-leg",
        "the leg to the camera not attenuated",
        _PANELS,
        _EXPONENT,
        "    up_rate = 0.5 * s * sigma_t * height\n    exponent = up_rate[:, None] * (e + inverse)\n",
    ),
    _quadrature(
        "distance-not-squared", "1/r in the place of 1/r^2", _PANELS, "    f *= kernel\n", "    f *= height[:, None]\n"
    ),
    _quadrature(
        "end-at-one-optical-depth",
        "rays end after one mean free path",
        _SUMS,
        _END,
        "            np.clip(x1, x0, np.maximum(x0, 1 / sigma_t)),\n",
    ),
    _quadrature(
        "near-clip",
        "the first 0.2 m before the camera left out, as by a near clip plane",
        _SUMS,
        _START,
        _START.replace("0.0)", "0.2)"),
    ),
)

_PHASES = (
    _quadrature("forward-is-backward", "the sign of g swapped", _PHASE, _HG, _HG.replace("self.g", "-self.g")),
    _quadrature(
        "henyey-greenstein-of-two",
        "Henyey and Greenstein's function normalised to 2",
        _PHASE,
        "return (1 - g) * (1 + g) / (base",
        "return 2 * (1 - g) * (1 + g) / (base",
    ),
    _quadrature(
        "henyey-greenstein-squared",
        "an exponent of 1 in the place of 3/2 in Henyey and Greenstein's function",
        _PHASE,
        "(base * np.sqrt(base))",
        "base",
    ),
    _quadrature(
        "rayleigh-of-two",
        "3/2 in the place of Rayleigh's 3/4",
        _PHASE,
        "0.75 + 0.75 * np.square(up - down)",
        "1.5 + 1.5 * np.square(up - down)",
    ),
    _quadrature(
        "rayleigh-without-lobes",
        "Rayleigh's function without its dependence on the angle",
        _PHASE,
        "0.75 + 0.75 * np.square(up - down)",
        "np.ones_like(up)",
    ),
)

_LIGHTS = (
    _quadrature(
        "radians-for-degrees",
        "the cone of a spot read in the wrong unit",
        "reference.scene.read",
        'np.deg2rad(float(parameters["cutoff_angle"][0]))',
        'float(parameters["cutoff_angle"][0]) % np.pi',
    ),
    _quadrature(
        "wide-spot",
        "the whole angle of a spot's cone taken for half of it",
        "reference.scene.read",
        'np.deg2rad(float(parameters["cutoff_angle"][0]))',
        '2 * np.deg2rad(float(parameters["cutoff_angle"][0]))',
    ),
    _quadrature(
        "falloff-in-the-cosine",
        "a soft spot linear in the cosine, not in the angle",
        _CONE,
        "np.clip((light.cutoff - angle) / (light.cutoff - light.beam), 0.0, 1.0)",
        "np.clip((np.cos(angle) - np.cos(light.cutoff)) / (np.cos(light.beam) - np.cos(light.cutoff)), 0.0, 1.0)",
        "the built-in scenes have no soft spot",
    ),
    _quadrature(
        "hard-spot",
        "the falloff of a soft spot left out",
        _CONE,
        "if light.axis is None or light.beam >= light.cutoff:\n        return np.ones_like(theta)",
        "if True:\n        return np.ones_like(theta)",
        "the built-in scenes have no soft spot",
    ),
    _quadrature(
        "first-light-only",
        "all lights but the first ignored",
        "reference.quadrature.ray_values",
        "airlight += received.radiance",
        "airlight += received.radiance * (number == 0)",
        "the built-in scenes have one light each",
    ),
    _quadrature(
        "no-light-behind",
        "a light behind the camera ignored",
        _SUMS,
        "foot, height = rays.foot[ray], rays.height[ray]\n",
        "foot, height = rays.foot[ray], rays.height[ray]\n    high = np.where(foot > 0, high, low)\n",
        "the built-in scenes have no light behind the camera",
    ),
)

_SHADOWS = (
    _quadrature(
        "near-segment-skipped",
        "the lit interval that begins at the camera left out",
        _SUMS,
        _END,
        "            np.where(x0 > 0, np.maximum(x1, x0), x0),\n",
    ),
    _quadrature(
        "shadow-for-light",
        "lit and shadowed intervals confused",
        _GEOMETRY,
        "return used[rows[wide]], begins[wide], finish[wide]",
        "return used[row], begin, end",
    ),
    _quadrature(
        "no-shadows",
        "the fog lit through everything",
        _GEOMETRY,
        "hidden = (end - begin) * scale[row] > _MERGE",
        "hidden = np.zeros(len(row), dtype=bool)",
    ),
    _quadrature(
        "thin-shadows-missed",
        "shadows and gaps below a hundredth of the ray stepped over, as by too few samples",
        _GEOMETRY,
        "_MERGE = 1e-12",
        "_MERGE = 1e-2",
    ),
    _quadrature(
        "last-tenth-missed",
        "what begins in the last tenth of the way from the light to the ray casts no shadow",
        _GEOMETRY,
        "(y0 <= height) & (y1 > 0)",
        "(y0 <= 0.9 * height) & (y1 > 0)",
    ),
    _quadrature(
        "edges-shifted",
        "every shadow 0.01 rad too far along the ray",
        _GEOMETRY,
        "return row, np.minimum(angle_a, angle_b), np.maximum(angle_a, angle_b)",
        "return row, np.minimum(angle_a, angle_b) + 0.01, np.maximum(angle_a, angle_b) + 0.01",
    ),
    _quadrature(
        "no-sphere-shadows",
        "the fog lit through spheres",
        "reference.visibility.spheres",
        "dark = (c_y - disk <= height) & (c_y + disk > 0)",
        "dark = np.zeros(len(ray), dtype=bool)",
        "the built-in scenes consist of meshes",
    ),
    _quadrature(
        "through-surfaces",
        "rays not ended at the visible surface",
        "reference.quadrature.light_airlight",
        "theta1 = np.where(ended, ",
        "theta1 = np.where(ended & False, ",
    ),
)

_SURFACES = (
    _quadrature(
        "surface-without-cosine",
        "the cosine at the lit surface dropped",
        _SURFACE,
        "np.array(reflected * arriving, dtype=np.float64).T",
        "np.array(reflected * arriving / mi.Frame3f.cos_theta(interaction.to_local(towards.d)), dtype=np.float64).T",
    ),
    _quadrature(
        "surface-bright-shadow-leg",
        "the leg from the light to the surface not attenuated",
        _SURFACE,
        " + shadow_scale * np.array(towards.dist, dtype=np.float64)",
        "",
    ),
    _quadrature(
        "surface-bright-camera-leg",
        "the leg from the surface to the camera not attenuated",
        _SURFACE,
        "path = np.where(lit, hits.distance, 0) + ",
        "path = ",
    ),
    _quadrature(
        "surface-wrong-leg",
        "the leg to the camera counted twice, in the place of that to the light",
        _SURFACE,
        "shadow_scale * np.array(towards.dist, dtype=np.float64)",
        "np.where(lit, hits.distance, 0)",
    ),
    _quadrature(
        "surface-without-shadows",
        "the surface lit through everything",
        _SURFACE,
        "np.array(facing, dtype=bool) & reaches",
        "np.array(facing, dtype=bool)",
    ),
)

MUTATIONS: tuple[Mutation, ...] = _CONSTANTS + _ATTENUATION + _PHASES + _LIGHTS + _SHADOWS + _SURFACES
