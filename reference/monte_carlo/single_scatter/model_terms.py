# SPDX-License-Identifier: BSD-3-Clause
r"""The terms of an engine's equation (`reference.scene.model`) along camera rays, in Dr.Jit.

**What is estimated.** With z = c x, c the cosine of the angle between a ray and the camera's axis,
the light of a lamp that a ray receives is

    L = F int_near^end  q sigma_s p/(4 pi) I edge f(r) w(r) V e^(-A tau_c - b tau_l - M sigma_t) s dx

where tau_c is the optical depth from `near` to x, and tau_l that from the light to x. F is the
factor on lamps, and sigma_s, sigma_t are those at x. Depths along the axis in place of distances
shrink all steps of a ray by the same c: A = a c and s = c; else A = a and s = 1. A sun has its
irradiance E for I edge f w.

**Where the fog ends.** Let D be the distance of the surface, infinite without one. The fog reaches
from `near` to min(`far`, D'), where D' is D; with `axis-ends` the depth c D, taken for a distance;
with `axis-lookup` D/c, the distance whose depth is D, behind the surface. Planes across the axis at
NEAR and FAR cut the ray at NEAR/c and FAR/c. A fade ends the light of lamps and suns at END/c. A
surface is seen through all fog of its ray, also that behind it: its transmittance is
e^(-a_s tau), with the depth tau from `near` to min(`far`, D'), or e^(-a_s c tau) with depths along
the axis; behind a constant source it is 1 - cap at least.

**How distances are drawn.** Free flights have the rate A sigma_t, not sigma_t: for A < 1 the
weights e^(-A tau)/e^(-tau) would grow without bound. A = 0 leaves an even density over a finite
part. On an unbounded one any other rate is legal, since flights are one half of a mixture: the
other half are angles at the light, whose density goes as 1/r^2, so that weights are below a
multiple of r^2 f(r). (A law that falls more slowly than 1/r^2, where nothing attenuates or ends the
light, would have weights without bound; no model has one.) Under suns, free flights and an
even density share a part; an unbounded one is cut at 40 free paths of its least rate, beyond which
there are 4e-18 of the light. Ambient light is drawn in the same way.

**Fog that glows.** Ambient light of the radiance B adds int sigma_s B e^(-A tau_c) s dx. A constant
source C min(1 - e^(-A tau), cap), tau up to the end of the fog, has a closed form, as have the
lobes of suns, E max(cos, 0)^n (1 - e^(-A tau')), with tau' from START on where the ray reaches
`near`.
"""

import math
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.reference.monte_carlo.single_scatter.boundary_walk import Surroundings
from airlight.reference.monte_carlo.single_scatter.model_lamps import colour, number
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.model import Model
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.varying import GridMedium

_FOUR_PI = 4 * math.pi
_NO_SUM = (
    "model: {what}, and its light along rays without an end has no sum: nothing attenuates it; "
    "expected ends, a camera-path, or a medium with bounds"
)
_PHASES = ("isotropic", "rayleigh", "hazy", "murky", "hg", "cornette-shanks")


@dataclass(frozen=True)
class Scattering:
    """The phase function: Mitsuba's, none for lamps, or another."""

    kind: str  #: scene, none, or the name of a phase function
    #: media, and the g of each; one if all have the same
    g: "tuple[tuple[mi.Medium, mi.Float], ...]" = ()

    def per_steradian(
        self,
        medium: "mi.MediumPtr",
        point: "mi.MediumInteraction3f",
        towards: "mi.Vector3f",
        active: "mi.Bool",
        *,
        lamp: bool,
    ) -> "mi.Spectrum | mi.Float":
        """Return p/(4 pi) at points of a medium for light from unit directions [1/sr].

        `lamp`: whether the light is that of a lamp, which may scatter without a phase function.
        """
        if self.kind == "none" and lamp:
            return mi.Float(1)
        if self.kind in ("scene", "none"):
            return medium.phase_function().eval_pdf(
                mi.PhaseFunctionContext(), point, towards, active
            )[0]
        # Light from `towards` goes on to the camera along `wi`: both turned around.
        cosine = -dr.dot(towards, point.wi)
        up = 0.5 + 0.5 * cosine
        rise = 1 + cosine * cosine
        if self.kind == "isotropic":
            return mi.Float(1 / _FOUR_PI)
        if self.kind == "rayleigh":
            return 0.75 / _FOUR_PI * rise
        # The mean of up^n over the sphere is 1/(n + 1): 1 + (n + 1) k up^n has the mean 1 + k.
        if self.kind == "hazy":
            return (1 + 9 * up**8) / (2 * _FOUR_PI)
        if self.kind == "murky":
            return (1 + 50 * up**32) * (33 / 83 / _FOUR_PI)
        # Those with a g; 1 + g^2 - 2 g cos is (1 - g)^2 + 2 g (1 - cos).
        g = self._g_of(medium)
        lobe = (1 - g * g) * dr.power(dr.square(1 - g) + 2 * g * (1 - cosine), -1.5) / _FOUR_PI
        return lobe if self.kind == "hg" else lobe * rise * 1.5 / (2 + g * g)

    def _g_of(self, medium: "mi.MediumPtr") -> "mi.Float":
        (_, g), *others = self.g
        for plugin, value in others:
            g = dr.select(medium == mi.MediumPtr(plugin), value, g)
        return g


def scattering_of(reference: ReferenceScene) -> Scattering:
    """Return the phase function of a scene's model.

    Raises InputError for one that this estimator does not know.
    """
    word = reference.model.phase
    if word in ("scene", "none"):
        return Scattering(word)
    media = [each for each in (reference.medium, *reference.media) if each.plugin is not None]
    name = media[0].phase.name
    if name not in _PHASES:
        raise InputError(
            f"model: phase is '{word}', which single-scatter does not know; expected one of "
            f"{', '.join(_PHASES)}, or take quadrature"
        )
    each_g = [(medium.plugin, float(getattr(medium.phase, "g", 0.0))) for medium in media]
    alike = len({g for _, g in each_g}) == 1
    return Scattering(
        name,
        tuple((plugin, dr.opaque(mi.Float, g)) for plugin, g in (each_g[:1] if alike else each_g)),
    )


@dataclass(frozen=True)
class FogEnds:
    """Where the fog begins and ends along camera rays."""

    near: "mi.Float64"  #: [m]
    end: "mi.Float64"  #: may be infinite, or before `near` [m]
    cosine: "mi.Float64"  #: c, of the angle to the camera's axis


@dataclass(frozen=True)
class RayTerms:
    """How the terms change the light of lamps, of suns or of surfaces along camera rays."""

    scattering: Scattering
    lamp: bool  #: whether the light is that of lamps
    camera: "mi.Float64"  #: A, of the depth between the fog and the camera
    light: "mi.Float64 | None"  #: b, of the depth between lights and the fog; None for 0
    length: "mi.Float64 | None"  #: M [m]
    weight: "mi.Float64"  #: F s
    fade: "tuple[mi.Float64, mi.Float64] | None"  #: distances at which q is 1 and 0 [m]
    opaque: Surroundings  #: what stands in the light
    #: light of suns that arrives through the medium around all others, 0 or 1 in each channel;
    #: None for all of it
    arriving: "mi.Color3f | None"
    #: the least transmittance to the camera, behind a source that covers no more than its cap
    least: "mi.Float | None" = None

    def weight_at(self, x: "mi.Float64") -> "mi.Float64":
        """Return F q s at distances along the rays [m]."""
        if self.fade is None:
            return self.weight
        start, end = self.fade
        return self.weight * dr.maximum((end - x) / (end - start), 0)


@dataclass(frozen=True)
class Lobe:
    """A power of the cosine about the direction of suns."""

    power: "mi.Float64 | None"  #: None for 0
    start: "mi.Float64"  #: distance from which on it counts [m]

    def at(self, cosine: "mi.Float") -> "mi.Float":
        """Return max(cos, 0)^n at cosines of the angle to a sun."""
        if self.power is None:
            return mi.Float(1)
        return dr.select(cosine > 0, dr.power(dr.maximum(cosine, 1e-30), mi.Float(self.power)), 0)


@dataclass(frozen=True)
class ModelTerms:
    """The terms of a model while a scene is traced; numbers are inputs of kernels."""

    model: Model
    axis: "mi.Vector3d"  #: of the camera, unit
    opaque: Surroundings  #: the opaque shapes alone
    scattering: Scattering
    arriving: "mi.Color3f | None"  #: see `RayTerms`
    camera: "mi.Float64"  #: a
    light: "mi.Float64 | None"  #: b; None for 0
    length: "mi.Float64 | None"  #: M [m]; None for 0
    surface_camera: "mi.Float64"  #: a of surfaces
    surface_light: "mi.Float64 | None"  #: b of surfaces; None for 0
    near: "mi.Float64"  #: [m]
    far: "mi.Float64"  #: [m]
    fade: "tuple[mi.Float64, mi.Float64] | None"  #: depths at which q is 1 and 0 [m]
    factors: "tuple[mi.Float64, mi.Float64, mi.Float64]"  #: on lamps, suns and surfaces
    constant: "mi.Color3f | None"
    most: "mi.Float64"  #: cap of a constant source
    lobe: Lobe | None
    ambient: "mi.Color3f | None"

    def ends(self, cosine: "mi.Float64", distance: "mi.Float64") -> FogEnds:
        """Return where the fog begins and ends along rays, given the cosines of their angles to the
        axis, and the distances of surfaces, infinite without one [m].
        """
        words = self.model
        end = {"axis-ends": distance * cosine, "axis-lookup": distance / cosine}.get(
            words.depth, distance
        )
        across = 1 / cosine if words.ends_of.planes else mi.Float64(1)
        return FogEnds(self.near * across, dr.minimum(end, self.far * across), cosine)

    def ends_of_lights(self, ends: FogEnds) -> FogEnds:
        """Return the ends for the light of lamps and suns, which a fade may end before."""
        if self.fade is None:
            return ends
        return FogEnds(ends.near, dr.minimum(ends.end, self.fade[1] / ends.cosine), ends.cosine)

    def step(self, cosine: "mi.Float64") -> "mi.Float64":
        """Return s, the depth that stands for a length of one along rays."""
        return cosine if self.model.depth == "axis" else mi.Float64(1)

    def along(self, cosine: "mi.Float64", *, lamp: bool) -> RayTerms:
        """Return the terms of lamps or of suns along rays."""
        step, fade = self.step(cosine), self.fade
        return RayTerms(
            self.scattering,
            lamp,
            camera=self.camera * step,
            light=self.light,
            length=self.length,
            weight=self.factors[0 if lamp else 1] * step,
            fade=None if fade is None else (fade[0] / cosine, fade[1] / cosine),
            opaque=self.opaque,
            arriving=self.arriving,
        )

    def behind(self, cosine: "mi.Float64") -> RayTerms:
        """Return the terms of surfaces at the end of rays."""
        step = self.step(cosine)
        return replace(
            self.along(cosine, lamp=False),
            camera=self.surface_camera * step,
            light=self.surface_light,
            least=None if self.model.most == 1 else mi.Float(1 - self.most),
        )

    @property
    def glows(self) -> bool:
        """Whether the fog sends light of its own: ambient light or a constant source."""
        return self.ambient is not None or self.constant is not None

    def counts(self, *, lamp: bool) -> bool:
        """Return whether lamps, or suns, send light in the fog."""
        return self.model.constant is None and self.model.factors[0 if lamp else 1] > 0


def terms_of(reference: ReferenceScene) -> ModelTerms | None:
    """Return the terms of a scene's model; None for the physical equation.

    Raises InputError for a term that this estimator does not know.
    """
    model = reference.model
    if model.is_physical:
        return None
    _check(reference)
    (camera, light), medium = model.surface_paths, reference.medium
    # Nothing of a sun arrives through a medium without sides, in no channel that it attenuates.
    drowned = (
        medium.sigma_t > 0 if isinstance(medium, ReferenceMedium) else np.zeros(3, dtype=np.bool_)
    )
    ends, fade, lobe = model.ends_of, model.fade_of, model.lobe_of
    lamps, suns, surfaces = model.factors
    return ModelTerms(
        model,
        axis=mi.Vector3d(*(number(each) for each in reference.axis.tolist())),
        opaque=Surroundings.of(reference.occluders, False),
        scattering=scattering_of(reference),
        arriving=colour(np.where(drowned, 0.0, 1.0)) if drowned.any() else None,
        camera=number(model.camera_scale),
        light=_unless_0(model.light_scale),
        length=_unless_0(model.light_length),
        surface_camera=number(camera),
        surface_light=_unless_0(light),
        near=number(ends.near),
        far=number(ends.far),
        fade=None if fade is None else (number(fade[0]), number(fade[1])),
        factors=(number(lamps), number(suns), number(surfaces)),
        constant=None if model.constant is None else colour(model.constant),
        most=number(model.most),
        lobe=None if lobe is None else Lobe(_unless_0(lobe.power), number(lobe.start)),
        ambient=None if model.ambient_of is None else colour(model.ambient_of),
    )


def _unless_0(value: float) -> "mi.Float64 | None":
    return None if value == 0 else number(value)


def _check(reference: ReferenceScene) -> None:
    """Raise InputError for a model that this estimator cannot follow in a scene."""
    model, medium = reference.model, reference.medium
    if model.lit_scale is not None:
        raise InputError(
            f"model: lit is '{model.lit}', whose exponential no samples estimate without a bias; "
            "expected estimator 'quadrature'"
        )
    if model.constant is not None and isinstance(medium, GridMedium):
        raise InputError(
            "model: source is constant in a density grid, whose depths single-scatter estimates; "
            "expected estimator 'quadrature', or another medium"
        )
    # Along rays without an end something must attenuate or end the light.
    unbounded = isinstance(medium, ReferenceMedium) and bool(np.any(medium.sigma_t > 0))
    if not unbounded or model.camera_scale > 0 or math.isfinite(model.ends_of.far):
        return
    if model.ambient_of is not None:
        raise InputError(_NO_SUM.format(what=f"ambient is '{model.ambient}'"))
    if model.constant is not None or model.fade_of is not None:
        return
    if reference.directional and model.factors[1] > 0:
        name = reference.directional[0].emitter.id()
        raise InputError(_NO_SUM.format(what=f"light '{name}' is directional"))
