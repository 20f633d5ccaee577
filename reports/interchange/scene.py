# SPDX-License-Identifier: BSD-3-Clause
"""A scene in numbers, as another renderer needs them."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.phase import HenyeyGreenstein, Tabulated
from airlight.errors import InputError
from airlight.realtime.scene.read_scene import read_scene, scene_notes
from airlight.reference.scene.area_light import ReferenceAreaLight
from airlight.reference.scene.camera import camera_matrix
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.scene.varying import GridMedium, HeightMedium, VaryingMedium
from airlight.validation.scenes.engine_fog import ENGINES, parameters_of
from airlight.validation.scenes.loading import LoadedScene
from airlight.validation.scenes.names import is_random, scene_stem
from airlight.validation.scenes.random.scene import drawn_values

Array = NDArray[np.float64]


_FALLOFF = {
    "point": (
        "the same intensity in every direction; irradiance falls as 1/r^2, times exp(-sigma_t r)"
    ),
    "hard": (
        "full intensity within the cut-off angle of the axis, none beyond; then 1/r^2 exp(-sigma_t "
        "r)"
    ),
    "soft": "full intensity within the beam angle of the axis, none beyond the cut-off angle, between them "
    "intensity (cutoff - angle)/(cutoff - beam), linear in the angle; then 1/r^2 exp(-sigma_t r)",
    "directional": "from infinity, parallel: the same irradiance everywhere, times exp(-sigma_t length) of its way in "
    "the media",
    "area": "the same radiance in every direction on the side of the normal, none behind: irradiance as the light's "
    "projected solid angle, times exp(-sigma_t r)",
    "sky": "the same radiance from every direction, times exp(-sigma_t length) of its way in the media: the image has "
    "what media scatter and surfaces reflect of it, and behind them no sky",
}
CONVENTION = (
    "Linear RGB radiance in W/(m^2 sr), as the light's intensity in W/sr gives it: no exposure, no "
    "tone mapping, no "
    "gamma, no bloom. Single scattering: light - one scattering in the medium or one diffuse "
    "reflection - eye, "
    "attenuated by exp(-sigma_t length) along both segments of the path; no light but the lights "
    "and the sky that are described. "
    "The airlight alone "
    "is the layer `airlight`; the plain channels are airlight + surface. One ray through the "
    "centre of every pixel, or "
    "the mean over the pixel's area (a box filter): `compare` finds out which."
)


def describe_scene(loaded: LoadedScene) -> dict[str, Any]:
    """Return everything that a renderer needs to render a scene, at the size of
    its image, as plain data.

    These are dictionaries, not records: other programs read them as JSON, and their keys differ by
    the kind of a light or a medium.

    These are `scene`, `source`, `purpose`, `up`, `handedness`, `camera`, `medium`, `bounded_media`,
    `lights`, `sky`, `surfaces`, `radiance`, `model`, `notes` and `file`, of a random scene also
    `drawn`. `model` is None where the equation is the physical one; lights and media are those of
    the scene in either case.
    Lengths in metres, angles in degrees, extinction in 1/m, intensity in W/sr, power in W. Black
    shapes of area lights are among the lights, not the surfaces. `sky` is None where no light of
    one arrives. A scene without a reference is refused, with what is in the way.
    """
    # it refuses what `render` refuses, in its words
    model = loaded.model
    notes = tuple(
        read_scene(loaded.scene).features.notes if model.is_physical else scene_notes(loaded.scene)
    )
    scene = scene_as_it_is(loaded)
    # A custom scene and a built-in one have the same keys: another renderer reads them by name.
    camera = _camera(loaded.scene.sensors()[0], scene)
    described = {
        "scene": loaded.name,
        "source": str(loaded.path or loaded.name),
        "purpose": loaded.purpose,
        "up": up_axis(camera_matrix(loaded.scene.sensors()[0])[:3, 1]),
        "handedness": "right",
        "camera": camera,
        "medium": _medium(scene.medium),
        "bounded_media": [
            {"name": medium.name, **(_medium(medium) or {}), "bounds": _bounds(medium.bounds)}
            for medium in scene.media
        ],
        "lights": [
            *map(_light, scene.lights),
            *map(_directional, scene.directional),
            *map(_area, scene.area),
        ],
        "sky": None
        if scene.sky is None
        else {"radiance": _numbers(scene.sky), "falloff": _FALLOFF["sky"]},
        "surfaces": [
            surface(shape)
            for shape in scene.occluders.shapes()
            if not shape.is_emitter() or _reflects(shape)
        ],
        "radiance": CONVENTION,
        "model": None if model.is_physical else {"name": model.name, "terms": model.terms},
        "notes": list(notes),
        "file": {
            "name": f"{scene_stem(str(loaded.path or loaded.name))}.exr",
            "format": "OpenEXR, one part of scan lines, half or float",
            "layers": {
                "airlight": (
                    "airlight.R, airlight.G, airlight.B: the in-scattered light alone, if the "
                    "engine has it"
                ),
                "total": "R, G, B: airlight + surface",
            },
        },
    }
    # A random scene also lists the values that its seed drew.
    drawn = (
        {"drawn": drawn_values(loaded.name)}
        if loaded.path is None and is_random(loaded.name)
        else {}
    )
    return described | drawn


def scene_as_it_is(loaded: LoadedScene) -> ReferenceScene:
    """Return what a reference reads of a scene, with its own phase function and albedo."""
    model = loaded.model
    if model.is_physical:
        return read_reference(loaded.scene)
    # A model may have light where physics has none.
    plain = replace(model, phase="scene", lit="off", name=model.title)
    return read_reference(loaded.scene, plain)


def up_axis(up: Array) -> str:
    """Return the axis of the world that points up in the image most: 'x',
    '-x', 'y', '-y', 'z' or '-z'.
    """
    number = int(np.argmax(np.abs(up)))
    return ("-" if up[number] < 0 else "") + "xyz"[number]


def surface(shape: Any) -> dict[str, Any]:
    """Return the kind of an opaque shape and the light that it reflects."""
    import mitsuba as mi

    from airlight.reports.interchange.meshes import triangle_count

    # Whether the shape reflects diffusely and nothing else: of the lower ten bits, Mitsuba's kinds
    # of lobes, no other may be set.
    colour, textured = _reflectance(shape)
    flags = shape.bsdf().flags()
    kind = shape.class_name()
    return {
        "name": shape.id(),
        "kind": "Mesh" if shape.is_mesh() and kind != "Rectangle" else kind,
        "triangles": triangle_count(shape),
        "reflectance": colour,
        "textured": textured,
        "two_sided": bool(mi.has_flag(flags, mi.BSDFFlags.BackSide)),
        "diffuse": not flags
        & ~int(mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide)
        & 0x3FF,
    }


def _camera(sensor: Any, scene: ReferenceScene) -> dict[str, Any]:
    import mitsuba as mi

    # A scaling would change the units of depth, a shear the pixels, a mirror the handedness, and
    # another renderer takes none of them from position and axes.
    matrix = camera_matrix(sensor)
    if (
        not np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-5)
        or np.linalg.det(matrix[:3, :3]) < 0
    ):
        raise InputError(
            "the camera's to_world scales, shears or mirrors; expected a rotation and a translation"
        )
    # Mitsuba's x axis points to the left in the image: right is -x.
    x_fov = _number(float(mi.traverse(sensor)["x_fov"][0]))
    tangent = np.tan(0.5 * np.deg2rad(x_fov))
    return {
        "position": _numbers(matrix[:3, 3]),
        "forward": _numbers(matrix[:3, 2]),
        "right": _numbers(-matrix[:3, 0]),
        "up": _numbers(matrix[:3, 1]),
        "size": [scene.width, scene.height],
        "fov_horizontal": x_fov,
        "fov_vertical": float(2 * np.rad2deg(np.arctan(tangent * scene.height / scene.width))),
        "projection": "pinhole; square pixels; the pixel in column i and row j, counted from 0 at the upper left, "
        "looks through (i + 0.5, j + 0.5); no depth of field, no jitter; the medium begins at the "
        "pinhole, so let the "
        "near plane cut nothing away",
    }


def _medium(medium: ReferenceMedium | VaryingMedium) -> dict[str, Any] | None:
    """Return the numbers of a medium, None for a vacuum."""
    if medium.plugin is None:
        return None
    # The phase function and the albedo belong to every kind of medium.
    phase: dict[str, Any] = {"name": medium.phase.name}
    if isinstance(medium.phase, HenyeyGreenstein):
        phase["g"] = _number(medium.phase.g)
    if isinstance(medium.phase, Tabulated):
        phase["table"] = _numbers(medium.phase.table)
    scattering = {
        "albedo": _numbers(medium.albedo),
        "phase": phase | {"formula": _PHASES[medium.phase.name]},
    }
    # A grid is too large for a table: its box, its mean and its largest value stand for it.
    if isinstance(medium, GridMedium):
        return {
            "voxels": list(medium.values.shape[::-1]),
            "low": _numbers(medium.low),
            "high": _numbers(medium.high),
            "mean": _number(float(medium.values.mean())),
            "largest": _number(float(medium.values.max())),
            **scattering,
        }
    # Height fog has names and rules of its own in each engine.
    if isinstance(medium, HeightMedium):
        return {
            "layers": [
                dict(zip(("sigma_t", "base", "scale_height"), map(_number, layer), strict=True))
                for layer in medium.layers
            ],
            "constant": _number(medium.constant),
            "clamped": medium.clamped,
            "floor": _number(medium.floor),
            "cap": _number(medium.cap),
            "up": up_axis(medium.up),
            "engines": {name: _in_engine(name, medium) for name in ENGINES},
            **scattering,
        }
    # A homogeneous medium in all forms that renderers ask for. Its numbers are the rounded ones
    # that the table shows, so that sums agree.
    sigma_t, albedo = (np.array(_numbers(values)) for values in (medium.sigma_t, medium.albedo))
    return {
        "sigma_t": _numbers(sigma_t),
        "sigma_s": _numbers(albedo * sigma_t),
        "sigma_a": _numbers((1 - albedo) * sigma_t),
        "mean_free_path": [_number(1 / value) if value > 0 else None for value in sigma_t],
        **scattering,
    }


def _in_engine(name: str, medium: HeightMedium) -> dict[str, Any]:
    """Return the parameters of height fog in an engine, lengths in metres, or why it has none."""
    parameters = parameters_of(
        name, medium.layers, clamped=medium.clamped, constant=medium.constant
    )
    # An engine's fog may have fewer parameters than the layers need.
    if isinstance(parameters, str):
        return {"cannot": parameters}
    numbers = {key: _number(value) for key, value in parameters.items()}
    engine = ENGINES[name]
    return {
        "parameters": numbers,
        "not_physical": engine["unphysical"],
        "not_checked": engine["unchecked"],
    }


_PHASES = {
    "isotropic": "1/(4 pi) [1/sr]",
    "rayleigh": "3 (1 + cos^2)/(16 pi) [1/sr]",
    "hg": (
        "(1 - g^2)/(4 pi (1 + g^2 - 2 g cos)^1.5) [1/sr], cos = 1 forward: g > 0 scatters forward"
    ),
    "tabulated": (
        "linear between values at regular cosines from -1 (backward) to 1, divided by 4 pi times "
        "their mean"
    ),
}


def _bounds(bounds: Any) -> dict[str, Any]:
    from airlight.reference.scene.convex_bounds import Sphere

    if isinstance(bounds, Sphere):
        return {
            "kind": "sphere",
            "centre": _numbers(bounds.centre),
            "radius": _number(bounds.radius),
        }
    return {"kind": "convex mesh", "facets": len(bounds.offset)}


def spot_power_angle(beam: float, cutoff: float) -> float:
    r"""Return the power of a spot over the intensity on its axis [sr]; the angles in radians.

    Full intensity up to the beam angle b, linear in the angle down to zero at the
    cut-off c, has the power

        2 pi I (int_0^b sin(t) dt + int_b^c (c - t)/(c - b) sin(t) dt) = 2 pi I (1 - (sin(c) - sin(b))/(c - b)),

    by parts, and 2 pi I (1 - cos(c)) where b is c. Valid to 1e-8 for cut-offs of a
    hundredth of a degree or more.
    """
    # The difference of the sines is 2 cos((c + b)/2) sin((c - b)/2): sinc has no
    # cancellation as b goes to c.
    half = 0.5 * (cutoff - beam)
    return float(2 * np.pi * (1 - np.cos(0.5 * (cutoff + beam)) * np.sinc(half / np.pi)))


def _light(light: ReferenceLight) -> dict[str, Any]:
    # Engines differ in the power that they ask for: `power` is what the light sends,
    # `power_all_round` what a light of its intensity in all directions would send.
    intensity = np.array(_numbers(light.intensity))
    sphere = 4 * np.pi * intensity
    described: dict[str, Any] = {
        "kind": "point",
        "position": _numbers(light.position),
        "intensity": intensity.tolist(),
        "power": sphere.tolist(),
        "power_all_round": sphere.tolist(),
    }
    if light.axis is None:
        return described | {"falloff": _FALLOFF["point"]}
    return described | {
        "kind": "spot",
        "axis": _numbers(light.axis),
        "cutoff_angle": _number(np.rad2deg(light.cutoff)),
        "beam_angle": _number(np.rad2deg(light.beam)),
        "power": (spot_power_angle(light.beam, light.cutoff) * intensity).tolist(),
        "falloff": _FALLOFF["soft" if light.is_soft else "hard"],
    }


def _directional(light: DirectionalLight) -> dict[str, Any]:
    return {
        "kind": "directional",
        "axis": _numbers(light.direction),
        "irradiance": _numbers(light.irradiance),
        "falloff": _FALLOFF["directional"],
    }


def _area(light: ReferenceAreaLight) -> dict[str, Any]:
    r"""Return an area light: a Lambertian emitter of area A sends pi Le A, from
    a sphere of 4 pi r^2 too.
    """
    # Shapes share radiance, area and power; the rest says what each of them needs to be placed.
    radiance = np.array(_numbers(light.radiance))
    power = np.pi * light.area * radiance
    described: dict[str, Any] = {
        "kind": "area",
        "shape": light.kind,
        "name": light.name,
        "material": ("opaque" if _reflects(light.shape) else "black") if light.opaque else "null",
        "position": _numbers(light.centre),
        "area": light.area,
        "radiance": radiance.tolist(),
        "power": power.tolist(),
        "luminous_flux": luminous_flux(power),
        "falloff": _FALLOFF["area"],
    }
    if light.kind == "mesh":
        return described | {"triangles": len(light.triangles)}
    if light.kind == "sphere":
        return described | {"radius": _number(light.radius)}
    described |= {"axis": _numbers(light.normal), "across": _numbers(light.frame[0])}
    if light.kind == "disk":
        return described | {"radius": _number(light.radius)}
    return described | {"up": _numbers(light.frame[1]), "sides": _numbers(2 * light.half)}


def luminous_flux(power: Array) -> float:
    """Return the luminous flux [lm] of radiant power in three channels [W].

    The channels are taken for linear RGB with the primaries and the white of sRGB: 683 lm/W times
    the luminance of the triple, as colour-science has it. That is how Radiance and many engines
    count; a real spectrum of this power and colour has another, lower flux.
    """
    from colour.models import RGB_COLOURSPACE_sRGB

    # The efficacy of monochromatic light of 540 THz, which defines the lumen [lm/W].
    efficacy = 683.0
    return efficacy * float(RGB_COLOURSPACE_sRGB.matrix_RGB_to_XYZ[1] @ power)


def _reflects(shape: Any) -> bool:
    return any(_reflectance(shape)[0])


def _reflectance(shape: Any) -> tuple[list[float], bool]:
    """Return the diffuse reflectance, its mean where it differs from place to
    place, and whether it does.
    """
    import drjit as dr
    import mitsuba as mi

    count = 64  # samples, to tell a texture from a colour
    number = np.arange(count)
    # evenly spread: Kronecker's points
    place = mi.Point2f((number + 0.5) / count, number * 0.6180339887 % 1)
    # Points by area on the shape, seen along the normal: a diffuse reflectance does not depend on
    # the direction. Its spread over the points tells a texture.
    sample = shape.sample_position(0, place)
    interaction = mi.SurfaceInteraction3f(sample, dr.zeros(mi.Color0f))
    interaction.wi = mi.Vector3f(0, 0, 1)
    values = np.array(shape.bsdf().eval_diffuse_reflectance(interaction), dtype=np.float64).reshape(
        3, -1
    )
    return _numbers(values.mean(axis=1)), bool(np.ptp(values, axis=1).max() > 1e-6)


def _numbers(values: Any) -> list[float]:
    return [_number(value) for value in np.asarray(values, dtype=np.float64).reshape(-1)]


def _number(value: float) -> float:
    """Return a number that float32 rounded as the one that was meant: 0.91
    instead of 0.9100000262260437.
    """
    # str follows the print options of the process
    short = float(np.format_float_scientific(np.float32(value)))
    # A number with more digits than float32 holds is kept; + 0.0 removes the sign of a zero.
    return (short if abs(short - value) <= 1e-7 * abs(value) else float(value)) + 0.0
