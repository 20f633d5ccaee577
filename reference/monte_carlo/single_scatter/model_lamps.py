# SPDX-License-Identifier: BSD-3-Clause
r"""How lamps shine in the equation of a model: distance laws, ranges and edges of spots, in Dr.Jit.

In the fog f(r) w(r) stands for 1/r^2. On surfaces Mitsuba's irradiance I cos/r^2 is multiplied by
r^2 f(r) w(r). A range cuts a ray at s = +- sqrt(R^2 - h^2) from the foot of the light.

**Angles at the light** are drawn as at a light at the height sqrt(h^2 + e) over the ray, e that of
a softened law, r0^2 of a clamped one and R0^2 of a sphere: the density of distances is then in
proportion to 1/(h^2 + s^2 + e), and follows the law close to the light too.

**Edges of spots.** With v = 1 - c for each cosine, (c - cc)/(cb - cc) = (vc - v)/(vc - vb). The
angle to the axis has v = \|w - axis\|^2/2, w the unit direction: no digits are lost in narrow
cones. Mitsuba's emitter gives the intensity on the axis.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.reference.scene.model import Law, Model, Range


def number(value: float) -> "mi.Float64":
    """Return a number of a model as an input of kernels, which other numbers do not compile
    again.
    """
    return dr.opaque(mi.Float64, value)


def colour(values: Iterable[float]) -> "mi.Color3f":
    """Return a colour of a model as an input of kernels."""
    made = mi.Color3f(*(float(each) for each in values))
    dr.make_opaque(made)
    return made


@dataclass(frozen=True)
class _DistanceLaw:
    """f(r) of a lamp."""

    kind: str  #: power, softened, clamped or sphere
    inverse_square: bool  #: whether the power is 2, which needs no logarithm
    area: "mi.Float64"  #: e, r0^2 or R0^2 [m^2]
    power: "mi.Float64"  #: d
    scale: "mi.Float64"  #: s

    def at(self, square: "mi.Float64") -> "mi.Float64":
        """Return f at squared distances [m^2]."""
        if self.kind == "softened":
            return self.scale / (square + self.area)
        if self.kind == "sphere":
            outer = square + self.area
            return 2 / (outer + dr.sqrt(square * outer))
        nearest = dr.maximum(square, self.area) if self.kind == "clamped" else square
        return 1 / nearest if self.inverse_square else dr.power(nearest, -0.5 * self.power)


def _distance_law(law: Law) -> _DistanceLaw:
    return _DistanceLaw(
        law.kind, law.power == 2, number(law.length**2), number(law.power), number(law.scale)
    )


@dataclass(frozen=True)
class Falloff:
    """How the light of lamps falls with the distance, up to their range."""

    fog: _DistanceLaw
    surface: _DistanceLaw
    window: Range | None
    reach: "mi.Float64"  #: R, infinite without a range [m]

    def in_fog(self, square: "mi.Float64") -> "mi.Float64":
        """Return f w at squared distances [m^2]."""
        return self.fog.at(square) * self._window(square)

    def on_surface(self, square: "mi.Float64") -> "mi.Float64":
        """Return r^2 f w at squared distances [m^2]."""
        return square * self.surface.at(square) * self._window(square)

    def sampling_height(self, height: "mi.Float64") -> "mi.Float64":
        """Return the height over the ray of a light with the same angles [m]."""
        return height if self.fog.kind == "power" else dr.sqrt(height * height + self.fog.area)

    def half_chord(self, height: "mi.Float64") -> "mi.Float64":
        """Return how far from the foot a ray leaves the range [m], below 0 where it misses it."""
        inside = self.reach * self.reach - height * height
        return dr.select(inside > 0, dr.sqrt(dr.maximum(inside, 0)), -1)

    def _window(self, square: "mi.Float64") -> "mi.Float64":
        if self.window is None:
            return mi.Float64(1)
        # s^2, and 0 beyond the range.
        s2 = square / (self.reach * self.reach)
        inside = {
            "quartic": lambda: dr.square(1 - s2 * s2),
            "fourth": lambda: 1 - s2 * s2,
            "square": lambda: dr.square(1 - s2),
            "linear": lambda: 1 - dr.sqrt(s2),
            "cut": lambda: mi.Float64(1),
        }[self.window.kind]()
        return dr.select(s2 < 1, inside, 0)


def falloff_of(model: Model) -> Falloff:
    """Return the falloff of a model."""
    window = model.range_of
    return Falloff(
        _distance_law(model.law_of(surface=False)),
        _distance_law(model.law_of(surface=True)),
        window,
        number(math.inf if window is None else window.end),
    )


@dataclass(frozen=True)
class SpotEdge:
    """The edge of a spot in place of Mitsuba's."""

    kind: str  #: cosine-squared, cosine-smooth or rim
    intensity: "mi.Color3f"  #: on the axis [W/sr]
    axis: "mi.Vector3f"  #: unit vector
    beam: "mi.Float"  #: 1 - cosine of the beam
    cutoff: "mi.Float"  #: 1 - cosine of the cutoff
    power: "mi.Float"  #: k of a rim

    def sent(self, from_light: "mi.Vector3f") -> "mi.Spectrum":
        """Return the intensity in unit directions [W/sr]."""
        v = 0.5 * dr.squared_norm(from_light - self.axis)
        if self.kind == "rim":
            edge = 1 - dr.power(v / self.cutoff, self.power)
        else:
            # A hard edge has no width: all of the cone is then within the beam.
            width = dr.select(self.cutoff > self.beam, self.cutoff - self.beam, 1)
            t = dr.select(v <= self.beam, 1, dr.clip((self.cutoff - v) / width, 0, 1))
            edge = t * t * (3 - 2 * t if self.kind == "cosine-smooth" else 1)
        return self.intensity * dr.select(v < self.cutoff, edge, 0)


def spot_edge(model: Model, emitter: "mi.Emitter", axis: "mi.Vector3d") -> SpotEdge | None:
    """Return the edge of a spot; None for Mitsuba's own. `axis`: unit vector."""
    kind, power = model.spot_of
    if kind == "angle":
        return None
    # Mitsuba's own answer at a far point on the axis: the rounding of places does not turn the way.
    place, _ = emitter.sample_direction(dr.zeros(mi.Interaction3f), mi.Point2f(0.5))
    far = dr.zeros(mi.Interaction3f)
    far.p = mi.Point3f(mi.Point3d(place.p) + axis * (1e3 * (1 + dr.norm(mi.Vector3d(place.p)))))
    sample, irradiance = emitter.sample_direction(far, mi.Point2f(0.5))
    parameters = mi.traverse(emitter)
    beam, cutoff = (
        2 * math.sin(math.radians(0.5 * float(np.ravel(parameters[name])[0]))) ** 2
        for name in ("beam_width", "cutoff_angle")
    )
    return SpotEdge(
        kind,
        colour(np.ravel(irradiance * sample.dist * sample.dist)),
        mi.Vector3f(axis),
        beam=dr.opaque(mi.Float, min(beam, cutoff)),
        cutoff=dr.opaque(mi.Float, cutoff),
        power=dr.opaque(mi.Float, power),
    )
