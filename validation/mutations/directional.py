# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the physics of directional lights, in the quadrature and in `single-scatter`."""

from validation.mutations.record import Mutation

_SUMS = "reference.quadrature.directional_sums"
_GEOMETRY = "reference.visibility.directional_geometry"
_LIGHT = "reference.monte_carlo.single_scatter.estimator"
_REMARK = "the scenes of the standard run have no directional light"


def _fault(name: str, meaning: str, module: str, old: str, new: str, estimator: str = "quadrature") -> Mutation:
    return Mutation(name, meaning, estimator, module, old, new, _REMARK)


QUADRATURE: tuple[Mutation, ...] = (
    _fault(
        "directional-without-four-pi",
        "the 1/(4 pi) of the phase function dropped under directional lights",
        _SUMS,
        "factor = light.irradiance / (4 * np.pi)",
        "factor = light.irradiance",
    ),
    _fault(
        "directional-bright-leg",
        "the leg from a directional light not attenuated",
        _SUMS,
        "np.maximum(length(rows, x), 0.0)[:, :, None] * medium.sigma_t",
        "np.maximum(length(rows, x), 0.0)[:, :, None] * 0",
    ),
    _fault(
        "directional-leg-both-ways",
        "the leg from a directional light followed on behind the scattering point",
        _SUMS,
        "((enter, low <= 0), ",
        "((enter, low < -np.inf), ",
    ),
    _fault(
        "directional-chord-both-ways",
        "the leg through a sphere followed on behind the scattering point",
        _SUMS,
        "np.maximum(closest - half, 0.0)",
        "(closest - half)",
    ),
    _fault(
        "directional-forward-is-backward",
        "the direction of a directional light reversed in the phase function",
        _SUMS,
        "phase(np.clip(cosine[chosen], -1, 1))",
        "phase(-np.clip(cosine[chosen], -1, 1))",
    ),
    _fault(
        "directional-corners-behind",
        "the pieces of a ray cut where legs pass the corners behind it, not those before it",
        _SUMS,
        "ahead = (y > 0)",
        "ahead = (y < 0)",
    ),
    _fault(
        "directional-shadows-leaning-back",
        "the shadows of triangles brought down to the ray the wrong way round",
        _GEOMETRY,
        "slope = (rays.cosine / rays.sine)",
        "slope = -(rays.cosine / rays.sine)",
    ),
    _fault(
        "directional-no-shadows",
        "the fog lit through all triangles",
        _GEOMETRY,
        "keep = np.flatnonzero(np.maximum(y0, y1) > 0)",
        "keep = np.flatnonzero(np.maximum(y0, y1) > np.inf)",
    ),
    _fault(
        "directional-no-sphere-shadows",
        "the fog lit through all spheres",
        _GEOMETRY,
        "dark = np.flatnonzero(c_y + disk > 0)",
        "dark = np.flatnonzero(c_y + disk > np.inf)",
    ),
    _fault(
        "directional-surface-bright-leg",
        "the leg from a directional light to the surface not attenuated",
        "reference.quadrature.surface",
        "-to_camera - optical_depth(",
        "-to_camera - 0 * optical_depth(",
    ),
)

SINGLE_SCATTER: tuple[Mutation, ...] = (
    _fault(
        "traced-directional-uniform-density",
        "the density of free flights left out under directional lights",
        "reference.monte_carlo.single_scatter.directional_sampling",
        "density = 0.5 / length + share * sum(",
        "density = 1 / length + 0 * sum(",
        "single-scatter",
    ),
    _fault(
        "traced-directional-bright-leg",
        "the leg from a directional light not attenuated",
        _LIGHT,
        "return irradiance * leg, sample.d",
        "return dr.select(leg > 0, irradiance, 0), sample.d",
        "single-scatter",
    ),
    _fault(
        "traced-directional-bright-camera-leg",
        "the leg to the camera counted to the boundary alone, under a directional light",
        _LIGHT,
        "dr.exp(-stretch.depth - stretch.sigma_t * y)",
        "dr.exp(-stretch.depth)",
        "single-scatter",
    ),
    _fault(
        "traced-directional-forward-is-backward",
        "the direction of a directional light reversed in the phase function",
        _LIGHT,
        "point, towards, active)",
        "point, -towards, active)",
        "single-scatter",
    ),
)
