# SPDX-License-Identifier: BSD-3-Clause
"""Airlight without volumetric shadows: one integral from the camera to the visible
surface, for each light.

Three published closed forms of fog shading take its place with `form`. They are no airlight: a fog
colour C, blended by an amount F of fog, without phase function, paths from lights and shadows,

    L = C F,     C = albedo (Ls + sum_k E_k q(cos_k)/(4 pi)),     F = 1 - exp(-tau),

Ls the radiance of a uniform sky and E_k the irradiances of suns. Artists choose C. Here the mean of
q over the sphere is 1, so that no more light is scattered than there is. Local lights have no term
in these forms, and are refused.

- `wenzel`: q = 1. Wenzel 2006 and 2007: the optical depth of an exponential layer in
  closed form, and one colour.
- `quilez`: q = 18 max(cos, 0)^8, F = tau up to 1. Quilez 2010, "Better fog": `mix(colours,
  pow(max(dot, 0), 8))`, and height fog that mixes by `(a/b) exp(-b y) (1 - exp(-b t dy))/dy`, the
  optical depth itself, which copies clamp.
- `unreal`: q = 10 max(cos, 0)^4. HeightFogCommon.ush: `FogColor (1 - 2^-I)` and
  `DirectionalInscatteringColor pow(saturate(dot), DirectionalInscatteringExponent) (1 - 2^-I)`, the
  exponent 4 by default.

The depth is the optical depth of the scene's medium. Unreal's two terms of a series near level rays
(8e-6 of the depth) and its FogMaxOpacity, StartDistance and cut-off are left out.
"""

from dataclasses import dataclass

import drjit as dr

from airlight.errors import InputError
from airlight.realtime.methods.interface.method import Layers, Method
from airlight.realtime.numerics.functions import opacity
from airlight.realtime.parameters import parameter

_EXPONENTS = {"wenzel": 0, "quilez": 8, "unreal": 4}  # of the cosine about a sun


@dataclass(frozen=True)
class Unshadowed(Method):
    """Airlight as if nothing cast a shadow.

    Valid for any scene without occluders between a light and a visible part of the medium;
    elsewhere it shows how much light the volumetric shadows take away. Bounded media have their own
    nodes; lights at places take the kernel `exact` alone there.

    References
    ----------
    Biri, Arques, Michelin 2006, eq. 2. Sun, Ramamoorthi, Narasimhan, Nayar 2005. The
    module cites the other forms.
    """

    name = "unshadowed"
    summary = "one airlight integral a ray and light, no volumetric shadows"
    source = "Biri, Arques, Michelin 2006, section 4.1; Sun et al. 2005"
    shadows = False

    form: str = parameter(
        "airlight",
        "the airlight, or a fog colour without light paths and phase function, as shaders blend it "
        "over an image: only "
        "suns and skies have one",
        choices=("airlight", *_EXPONENTS),
    )

    @property
    def uses_kernel(self):
        """Closed forms of shading ask no kernel."""
        return self.form == "airlight"

    @property
    def by_table(self):
        """Light that nothing shadows needs no state."""
        return self.form == "airlight"

    @property
    def at_once(self):
        """A fog colour is one for all lights."""
        return self.form != "airlight"

    def check(self, scene):
        """Refuse a fog colour of local lights."""
        local = next((light for light in scene.lights if light.w), None)
        if self.form != "airlight" and local is not None:
            raise InputError(
                f"form={self.form}: a fog colour has no term for local lights, and the scene has "
                f"one of kind '{local.kind}'; expected 'directional' lights alone, or form=airlight"
            )

    def preparation(self, scene):
        """Return a function for the radiance of the sky, for a fog colour."""
        return super().preparation(scene) if self.form == "airlight" else lambda now: now.sky

    def render(self, view, state, kernel):
        """Return the airlight of every ray, or what the closed form shows
        in its place [W/(m^2 sr)].
        """
        return (
            super().render(view, state, kernel)
            if self.form == "airlight"
            else Layers(self._colour(view, state))
        )

    def _colour(self, view, sky):
        medium, end, exponent = view.medium, dr.minimum(view.distance, 1e30), _EXPONENTS[self.form]
        # C without the albedo: the radiance of the sky and E_k q(cos_k)/(4 pi) of each sun. The
        # mean of q = 2 (n + 1) max(cos, 0)^n over the sphere is 1, for `wenzel` with q = 1.
        arriving = sky
        for light in view.lights:
            if not light.w:
                ahead = dr.maximum(-dr.dot(light.axis, view.direction), 0)
                lobe = 2 * (exponent + 1) * ahead**exponent if exponent else 1
                arriving = arriving + light.intensity * (lobe * (0.25 * dr.inv_pi))
        # C F with F = 1 - exp(-tau): `ambient` has the albedo and F of the medium.
        radiance = arriving * medium.ambient(view, end)
        if self.form != "quilez":
            return radiance
        # `quilez` has F = min(tau, 1): multiply by min(tau, 1) / (1 - exp(-tau)) in each channel.
        # The limit at tau = 0 is 1.
        depths = medium.optical_depth(view, 0, end)
        corrections = [dr.select(tau > 0, dr.minimum(tau, 1) / opacity(tau), 1) for tau in depths]
        return radiance * medium.colour(corrections)

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray as if nothing cast a shadow [W/(m^2 sr)]."""
        airlight = view.lit_by(light, kernel)
        return airlight.radiance(airlight.gamma(view.distance))

    def error_causes(self, size):
        """Return shadows, which nothing takes away."""
        return (("shadows", None),)


def unshadowed(view, *, kernel):
    """Return the airlight of all lights of a view as if nothing cast a shadow, for a
    user's function [W/(m^2 sr)].
    """
    return Unshadowed().render(view, (), kernel).in_scattered
