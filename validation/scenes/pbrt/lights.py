# SPDX-License-Identifier: BSD-3-Clause
r"""The lights of pbrt as emitters of Mitsuba.

Colours are taken as they are, as radiance or intensity in linear sRGB. pbrt-v4 divides the spectrum
of a light by its luminance, so that the film's sensor `cie1931`, which has no exposure, gives back
the `rgb` values that the file has.

**The edge of a spot.** With t = (cos a - cos e)/(cos s - cos e), at the angle a between the angle s,
where the edge begins, and the cone's angle e, pbrt-v4 has t^2 (3 - 2 t), pbrt-v3 t^4, and Mitsuba
(e - a)/(e - s). A function f of the angle that is linear between angles a_0 = s < ... < a_n = e is
a sum of Mitsuba's,

    f(a) = sum_i (f(a_i) - f(a_i+1)) edge(a; a_i, a_i+1),

each of which is 1 up to its beam width a_i and 0 beyond its cut-off angle a_i+1. A soft spot becomes
n such spots. The error of linear interpolation in a step h is f'' h^2 / 8, so steps in proportion
to |f''|^(-1/2) make it even; what remains is measured and said in a note.
"""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

from airlight.reference.scene.transforms import SAME, stretch
from airlight.validation.arrays import Array
from airlight.validation.scenes.pbrt.directives import Directive, check_names, colour, number, point
from airlight.validation.scenes.pbrt.state import Part

_WHITE = (1.0, 1.0, 1.0)
_PIECES = 8  # of the edge of a spot: they are within 0.9 % of the intensity


def words(values: ArrayLike) -> str:
    """Return numbers for an attribute, with all their digits."""
    return ", ".join(map(repr, np.asarray(values, dtype=np.float64).ravel().tolist()))


def rgb(name: str, values: ArrayLike) -> str:
    """Return a colour as an element of Mitsuba."""
    return f'<rgb name="{name}" value="{words(values)}"/>'


def to_world(matrix: Array) -> str:
    """Return a transform as an element of Mitsuba."""
    return f'<transform name="to_world"><matrix value="{words(matrix)}"/></transform>'


def facing(place: Array, axis: Array) -> Array:
    """Return a rotation and translation whose z is an axis, (4, 4); the other axes are free."""
    axis = axis / np.linalg.norm(axis)
    across = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
    across /= np.linalg.norm(across)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([across, np.cross(axis, across), axis, place])
    return matrix


def light(part: Part, name: str, flip: Array, version: int) -> tuple[list[str], list[str]]:
    """Return the emitters of a light, as XML, and notes on it.

    `flip`: from pbrt's world to ours, (4, 4); `version`: of pbrt, whose spots differ.
    """
    directive, matrix = part.directive, flip @ part.state.ctm
    kind, also = directive.type, ("samples", "nsamples")
    scale = colour(directive, "scale", _WHITE, light=True)
    match kind:
        case "point":
            check_names(directive, ("I", "scale", "power", "from", *also))
            place = matrix @ [*point(directive, "from", (0, 0, 0)), 1.0]
            intensity = _power(directive, 4 * np.pi) * scale * _colour(directive, "I")
            inner = rgb("intensity", intensity)
            return [_emitter("point", name, inner + _point("position", place[:3]))], []
        case "spot":
            return _spot(directive, matrix, name, version)
        case "distant":
            check_names(directive, ("L", "scale", "illuminance", "from", "to", *also))
            way = point(directive, "to", (0, 0, 1)) - point(directive, "from", (0, 0, 0))
            axis = matrix[:3, :3] @ way
            if not np.linalg.norm(axis) > 0:
                raise directive.error("from and to are one point; expected two")
            irradiance = scale * _colour(directive, "L") * _target(directive, "illuminance", 1.0)
            vector = f'<vector name="direction" value="{words(axis / np.linalg.norm(axis))}"/>'
            return [_emitter("directional", name, rgb("irradiance", irradiance) + vector)], []
        case "infinite":
            for key in ("mapname", "filename", "portal"):
                if key in directive.parameters:
                    raise directive.error(
                        f'it has "{key}", and images around a scene are not read; expected one '
                        "colour: give its mean as rgb L"
                    )
            check_names(directive, ("L", "scale", "illuminance", *also))
            # A sky of radiance 1 has the illuminance pi on the ground.
            radiance = scale * _colour(directive, "L") * _target(directive, "illuminance", np.pi)
            return [_emitter("constant", name, rgb("radiance", radiance))], []
    raise directive.error("is not read; expected one of point, spot, distant, infinite")


def _spot(
    directive: Directive, matrix: Array, name: str, version: int
) -> tuple[list[str], list[str]]:
    known = ("I", "scale", "power", "from", "to", "coneangle", "conedeltaangle")
    check_names(directive, (*known, "samples", "nsamples"))
    # A transform with one scale for all axes keeps the cone.
    if stretch(matrix) - 1 > SAME:
        raise directive.error("its transform stretches its cone; expected one scale for all axes")
    place = point(directive, "from", (0, 0, 0))
    axis = matrix[:3, :3] @ (point(directive, "to", (0, 0, 1)) - place)
    if not np.linalg.norm(axis) > 0:
        raise directive.error("from and to are one point; expected two")
    turned = facing((matrix @ [*place, 1.0])[:3], axis)
    cone = number(directive, "coneangle", 30.0)
    delta = number(directive, "conedeltaangle", 5.0)
    if not (0 < cone < 90 and 0 <= delta <= cone):
        raise directive.error(
            f"coneangle is {cone:g} and conedeltaangle {delta:g}; expected a cone of more than 0 "
            "and less than 90 degrees, and a delta from 0 to that"
        )
    start, end = np.cos(np.deg2rad([cone - delta, cone]))
    scale = colour(directive, "scale", _WHITE, light=True)
    solid_angle = 2 * np.pi * ((1 - start) + 0.5 * (start - end))
    intensity = _power(directive, solid_angle) * scale * _colour(directive, "I")
    if delta == 0:
        return [_one_spot(name, turned, intensity, cone, cone)], []
    # The edge in pieces (see the module).
    angles, falls, off = _edge(cone - delta, cone, version)
    spots = [
        _one_spot(f"{name}-{number}", turned, fall * intensity, beam, cutoff)
        for number, (fall, beam, cutoff) in enumerate(zip(falls, angles, angles[1:]), 1)
    ]
    note = (
        f"light '{name}': its edge from {cone - delta:g} to {cone:g} degrees, that of pbrt-v"
        f"{version}, is read as {len(spots)} spots with linear edges, within {100 * off:.1f} % of "
        "its intensity"
    )
    return spots, [note]


def _edge(beam: float, cone: float, version: int) -> tuple[Array, Array, float]:
    """Return the angles of the pieces of an edge [degrees], how far the intensity falls in each,
    and the largest error, both over the intensity on the axis.
    """
    angle = np.linspace(beam, cone, 4097)  # fine enough for the error to four digits
    start, end = np.cos(np.deg2rad([beam, cone]))
    t = (np.cos(np.deg2rad(angle)) - end) / (start - end)
    falloff = t * t * (3 - 2 * t) if version == 4 else t**4
    bend = np.sqrt(np.abs(np.gradient(np.gradient(falloff, angle), angle)))
    # Equal parts of the integral of |f''|^(1/2).
    steps = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]))])
    angles = np.interp(np.linspace(0, steps[-1], _PIECES + 1), steps, angle)
    values = np.interp(angles, angle, falloff)
    values[[0, -1]] = 1.0, 0.0
    off = float(np.abs(np.interp(angle, angles, values) - falloff).max())
    return angles, values[:-1] - values[1:], off


def _one_spot(name: str, matrix: Array, intensity: Array, beam: float, cutoff: float) -> str:
    angles = f'<float name="cutoff_angle" value="{float(cutoff)!r}"/>'
    angles += f'<float name="beam_width" value="{float(beam)!r}"/>'
    return _emitter("spot", name, rgb("intensity", intensity) + angles + to_world(matrix))


def _colour(directive: Directive, name: str) -> Array:
    return colour(directive, name, _WHITE, light=True)


def _power(directive: Directive, solid_angle: float) -> float:
    """Return the factor that gives a light of 1 [1/sr] the power that its file asks for."""
    return _target(directive, "power", solid_angle)


def _target(directive: Directive, name: str, of_one: float) -> float:
    """Return the factor that a quantity asks for, which is `of_one` for a light of 1; pbrt takes
    values of 0 and less for none.
    """
    wanted = number(directive, name, -1.0)
    return wanted / of_one if wanted > 0 else 1.0


def _point(name: str, place: Array) -> str:
    return f'<point name="{name}" value="{words(place)}"/>'


def _emitter(kind: str, name: str, inner: str) -> str:
    return f'<emitter type="{kind}" id={quoteattr(name)}>{inner}</emitter>'
