# SPDX-License-Identifier: BSD-3-Clause
"""The fog and the scenery of a model: the equation of an engine in the terms of the fog model.

`reference.scene.model` says what the terms mean. The fog model has each of them as a law of its
own; no formula of the quadrature is in it.
"""

from dataclasses import replace

from airlight.analytic.phase import CornetteShanks, HenyeyGreenstein, phase_from_words
from airlight.errors import InputError
from airlight.reference.scene.model import Law, Model
from airlight.reference.scene.read import ReferenceScene
from airlight.validation.fog_model.laws import Falloff, LawFactor, Window
from airlight.validation.fog_model.radiance import Colour, Fog, PhaseLaw, colour, scene_fog
from airlight.validation.fog_model.view import SCENERY, Scenery

#: where depth is taken for distance, by the term
_PLANAR = {
    "distance": frozenset[str](),
    "axis": frozenset({"nodes", "surfaces", "steps"}),
    "axis-ends": frozenset({"ends"}),
    "axis-lookup": frozenset({"lookup"}),
}
#: edges of spots, by the term
_EDGES = {"angle": "", "cosine-squared": "square", "cosine-smooth": "smoothstep", "rim": "rim"}
_WHITE: Colour = (1.0, 1.0, 1.0)


def fog_of_model(reference: ReferenceScene, model: Model) -> Fog:
    """Return the fog of a scene, as it was read for a model or for the physical equation, in the
    equation of the model.

    Raises InputError for Cornette and Shanks's phase function where the scene's has no g.
    """
    fog = scene_fog(reference)
    if model.is_physical:
        return fog
    # Lights count point and spot lights first, then directional ones, then area lights.
    lamps, suns, surface = model.factors
    far = len(reference.directional)
    kinds = [lamps] * len(reference.lights) + [suns] * far + [lamps] * len(reference.area)
    camera, light = model.surface_paths
    laws = tuple(model.law_of(surface=surface) for surface in (False, True))
    ends, lobe = model.ends_of, model.lobe_of
    return replace(
        fog,
        albedo=fog.albedo if model.lit_scale is None else (_WHITE,) * len(fog.albedo),
        phase=_phases(reference, fog, model),
        strength=tuple(kinds),
        surface=(surface,) * len(kinds),
        camera_segment=(model.camera_scale, camera),
        light_segment=(model.light_scale, light),
        light_length=model.light_length,
        near=ends.near,
        far=ends.far,
        spherical=not ends.planes,
        planar=_PLANAR[model.depth],
        law=(_factor(laws[0]), _factor(laws[1])),
        window=None if model.range_of is None else Window(model.range_of),
        corners=_corners(laws[0], model),
        bare=model.phase == "none",
        fade=model.fade_of,
        ambient=colour(model.ambient_of or (0.0, 0.0, 0.0)),
        constant=None if model.constant is None else colour(model.constant),
        most=model.most,
        lobe=None if lobe is None else (lobe.power, lobe.start),
        lit=model.lit_scale,
    )


def scenery_of_model(model: Model) -> Scenery:
    """Return the scenery of a model: how spots fall off."""
    kind, power = model.spot_of
    return replace(SCENERY, edge=_EDGES[kind], rim=power)


def _factor(law: Law) -> Falloff | None:
    return None if law.is_physical else LawFactor(law)


def _corners(law: Law, model: Model) -> tuple[float, ...]:
    """Return the distances at which the light of lamps has corners in the fog."""
    clamped = (law.length,) if law.kind == "clamped" else ()
    return clamped if model.range_of is None else (*clamped, model.range_of.end)


def _phases(
    reference: ReferenceScene, fog: Fog, model: Model
) -> tuple[float | PhaseLaw | None, ...]:
    """Return the phase function of each medium."""
    if model.phase in ("scene", "none"):
        return fog.phase
    if model.phase != "cornette-shanks":
        phase = phase_from_words(model.phase)
        law = phase.g if isinstance(phase, HenyeyGreenstein) else phase
        return (law,) * len(fog.phase)
    # Scenes that were read for this model have the function already.
    laws: list[PhaseLaw] = []
    for medium in (reference.medium, *reference.media):
        phase = medium.phase
        if not (isinstance(phase, CornetteShanks | HenyeyGreenstein) or phase.is_constant):
            raise InputError(
                f"model: cornette-shanks takes the g of the scene, whose phase function is "
                f"{phase.name}; expected hg or isotropic"
            )
        laws.append(CornetteShanks(getattr(phase, "g", 0.0)))
    return tuple(laws)
