# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the physics of lights with extent, in the quadrature and in `single-scatter`.

They are tried in the probe `wide-lights` alone: no other scene has such a light.
"""

from validation.mutations.record import Mutation

_POINTS = "reference.quadrature.light_points"
_SUMS = "reference.quadrature.area_airlight"
_SURFACE = "reference.quadrature.area_surface"
_SHAPE = "reference.scene.area_light"
_SCENE = "reference.scene.read"
_TRACED = "reference.monte_carlo.single_scatter.area_estimate"
_DRAWN = "reference.monte_carlo.single_scatter.area_sampling"
_REMARK = "the scenes of the standard run have no light with extent"


def _fault(name: str, meaning: str, module: str, old: str, new: str, estimator: str = "quadrature") -> Mutation:
    return Mutation(name, meaning, estimator, module, old, new, _REMARK, wide=True)


def _traced(name: str, meaning: str, module: str, old: str, new: str) -> Mutation:
    return _fault(f"traced-{name}", meaning, module, old, new, "single-scatter")


_SENT = "intensity, quarter = light.radiance * light.area,"
_OPAQUE = "        if not null:\n"
_EACH = "        for place, normal in zip(places, normals, strict=True)\n"

QUADRATURE: tuple[Mutation, ...] = (
    _fault(
        "area-without-cosine",
        "the cosine at the light dropped",
        _SUMS,
        "np.maximum(a[row, None] + b[row, None] * x, 0.0) / np.maximum(r, np.finfo(float).tiny)",
        "np.ones_like(r)",
    ),
    _fault(
        "area-both-sides",
        "light from both sides of every shape",
        _POINTS,
        _EACH,
        "        for place, normal in zip([*places, *places], [*normals, *-normals], strict=True)\n",
    ),
    _fault(
        "area-other-side",
        "light from the wrong side",
        _POINTS,
        "TruthLight(place, intensity, normal,",
        "TruthLight(place, intensity, -normal,",
    ),
    _fault(
        "area-wrong-count",
        "N - 1 in the place of N points",
        "reference.quadrature.replicates",
        "means = total / counts[:, None, None]",
        "means = total / (counts[:, None, None] - 1)",
    ),
    _fault(
        "area-projected-sphere",
        "the projected area of a sphere in the place of its area",
        _SHAPE,
        '(np.pi if self.kind == "disk" else 4 * np.pi)',
        "np.pi",
    ),
    _fault(
        "area-half-sides",
        "half the sides of a rectangle taken for its sides",
        _SHAPE,
        "float(4 * self.half[0] * self.half[1])",
        "float(self.half[0] * self.half[1])",
    ),
    _fault(
        "area-power-for-intensity",
        "the power pi Le A in the place of the intensity Le A",
        _POINTS,
        _SENT,
        _SENT.replace("light.area", "light.area * np.pi"),
    ),
    _fault(
        "area-radiance-for-intensity",
        "the radiance in the place of the intensity: no area",
        _POINTS,
        _SENT,
        _SENT.replace(" * light.area", ""),
    ),
    _fault(
        "area-polar-angles-evenly",
        "points on a sphere spread evenly over the angle from its pole",
        _POINTS,
        "1 - 2 * square[:, 0], 2 * np.pi",
        "np.cos(np.pi * square[:, 0]), 2 * np.pi",
    ),
    _fault(
        "area-square-for-disk",
        "the square around a disk in the place of the disk",
        _POINTS,
        'sides = _concentric(sides) if light.kind == "disk" else sides',
        "sides = 1.0 * sides",
    ),
    _fault(
        "area-shadows-itself",
        "a light hidden by its own shape",
        "reference.visibility.before_light",
        "others = [shape for shape in shapes if shape != light.shape]",
        "others = list(shapes)",
    ),
    _fault(
        "area-null-is-opaque",
        "a light of material null that ends rays and casts shadows",
        _SCENE,
        _OPAQUE,
        _OPAQUE.replace("not null", "not null or shape.is_emitter()"),
    ),
    _fault(
        "area-black-is-clear",
        "a black light that neither ends rays nor casts shadows",
        _SCENE,
        _OPAQUE,
        _OPAQUE.replace("not null", "not null and not shape.is_emitter()"),
    ),
    _fault(
        "area-surface-without-cosine",
        "the cosine at the light dropped on surfaces",
        _SURFACE,
        "seen.depth[row] / lines.height[of] ** 2)[:, None] * cosine",
        "1 / lines.height[of])[:, None] * np.ones_like(cosine)",
    ),
    _fault(
        "area-surface-bright-leg",
        "the leg from the light to the surface not attenuated",
        _SURFACE,
        "value = bsdf(point, towards) * np.exp(-depth)",
        "value = bsdf(point, towards) * np.exp(-0 * depth)",
    ),
    _fault(
        "area-surface-half-horizon",
        "half of what is above the horizon of a surface left out",
        "reference.visibility.light_lines",
        "above = np.maximum(ends[0], middle - 0.5 * np.pi)",
        "above = np.maximum(ends[0], middle)",
    ),
)

SINGLE_SCATTER: tuple[Mutation, ...] = (
    _traced("area-without-cosine", "the cosine at the light dropped", _TRACED, "width * cosine /", "width /"),
    _traced(
        "area-even-density",
        "points about the ray weighed as if they were spread evenly over a rectangle or disk",
        _DRAWN,
        "density = dr.select(counts, density, 0)",
        "density = dr.select(counts, 1 / light.area, 0)",
    ),
    _traced(
        "area-chord-density",
        "the density of points about a ray on a sphere twice too large",
        _DRAWN,
        "0.5 * share / (4 * math.pi * radius * chord)",
        "share / (4 * math.pi * radius * chord)",
    ),
    _traced(
        "area-sphere-evenly",
        "points on the side of the ray weighed as if they were spread evenly over the sphere",
        _DRAWN,
        "(1 - share) * (1 + dr.dot(normal, side)) / light.area",
        "(1 - share) / light.area",
    ),
    _traced(
        "area-projected-sphere",
        "the projected area of a sphere in the place of its area",
        _DRAWN,
        '"Sphere": 4 * math.pi * a * b}',
        '"Sphere": math.pi * a * b}',
    ),
    _traced(
        "area-bright-camera-leg",
        "the leg to the camera not attenuated",
        _TRACED,
        "dr.exp(-camera_leg) * weight",
        "weight",
    ),
    _traced(
        "area-forward-is-backward",
        "the direction of the light reversed in the phase function",
        _TRACED,
        "there, -from_light, used)",
        "there, from_light, used)",
    ),
    _traced(
        "area-surface-without-cosine",
        "the cosine at the light dropped on surfaces",
        _TRACED,
        "(cosine / (r * r * mi.Float(point.density) * task.samples))",
        "(1 / (r * r * mi.Float(point.density) * task.samples))",
    ),
    _traced(
        "area-surface-wrong-count",
        "N - 1 in the place of N points on surfaces",
        _TRACED,
        "mi.Float(point.density) * task.samples))",
        "mi.Float(point.density) * (task.samples - 1)))",
    ),
)
