# SPDX-License-Identifier: BSD-3-Clause
"""Reading a Mitsuba scene for the reference, in float64 NumPy.

`realtime.scene.read_scene` reads the same scene for the methods under test. The two share no code
on purpose: this one asks Mitsuba's emitters for their intensity and reads the parameters of the
medium, where the other does it the other way round.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.analytic.phase import (
    CornetteShanks,
    HenyeyGreenstein,
    Isotropic,
    phase_from_words,
)
from airlight.errors import InputError
from airlight.reference.scene.area_light import ReferenceAreaLight, is_area, read_area_light
from airlight.reference.scene.camera import (
    camera_matrix,
    film_directions,
    perspective_sensor,
    pixel_centres,
)
from airlight.reference.scene.colours import colour
from airlight.reference.scene.directional_light import (
    DirectionalLight,
    is_directional,
    read_directional,
)
from airlight.reference.scene.homogeneous_medium import (
    BoundedMedium,
    ReferenceMedium,
    read_bounded,
)
from airlight.reference.scene.medium_around import grid_in_a_shape, read_ambient
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.point_light import ReferenceLight, read_point_light
from airlight.reference.scene.shape_roles import scene_from, scene_of, sorted_shapes
from airlight.reference.scene.varying import NO_EXTINCTION, HeightMedium, VaryingMedium

Array = NDArray[np.float64]

_AROUND = ("ConstantBackgroundEmitter", "EnvironmentMapEmitter")


@dataclass(frozen=True)
class ReferenceScene:
    """A scene as the reference sees it."""

    scene: "mi.Scene"  #: all shapes
    occluders: "mi.Scene"  #: the opaque shapes alone: cast rays here
    width: int  #: [pixels]
    height: int  #: [pixels]
    origin: Array  #: the pinhole [m], (3,)
    direction: Array  #: unit directions through the pixel centres, (pixels, 3), row by row
    #: around the camera, a vacuum of extinction 0 where there is none
    medium: ReferenceMedium | VaryingMedium
    lights: tuple[ReferenceLight, ...]  #: point and spot lights
    media: tuple[BoundedMedium, ...] = ()  #: the media with bounds, disjoint
    #: directional lights; all media then have bounds, or a cap
    directional: tuple[DirectionalLight, ...] = ()
    area: tuple[ReferenceAreaLight, ...] = ()  #: area lights
    #: the emitter around the scene, visible behind it; not in `scene`
    background: "mi.Emitter | None" = None
    #: radiance of a uniform background, RGB [W/(m^2 sr)], which lights media and surfaces; None
    #: where none arrives: through an unbounded homogeneous medium
    sky: Array | None = None
    #: the equation; media already have its phase function, and the albedo 1 of a lit density
    model: Model = PHYSICAL

    @property
    def axis(self) -> Array:
        """The direction in which the camera looks, a unit vector."""
        return camera_matrix(self.scene.sensors()[0])[:3, 2]

    @property
    def is_sampled(self) -> bool:
        """Whether samples stand for some of the light, so that it has a standard error."""
        return bool(self.area) or self.sky is not None


def read_reference(scene: "mi.Scene", model: Model = PHYSICAL) -> ReferenceScene:
    """Read a Mitsuba scene of the current RGB variant, for the equation of a model.

    Raises InputError for a scene whose reference cannot be computed; the message names the shape,
    the light or the medium that is the reason.
    """
    sensor = perspective_sensor(scene)
    width, height = (int(n) for n in sensor.film().size())
    # Emitters shine from around the scene, from a direction, from an area or from a place.
    background = _background(scene)
    emitters = [emitter for emitter in scene.emitters() if emitter != background]
    points = [
        emitter for emitter in emitters if not is_directional(emitter) and not is_area(emitter)
    ]
    if not emitters and background is None:
        raise InputError(
            "the scene has no light; expected at least one emitter of type 'point', 'spot', "
            "'directional' or 'area'"
        )
    lights = tuple(read_point_light(emitter) for emitter in points)
    origin = camera_matrix(sensor)[:3, 3]
    area = tuple(read_area_light(emitter, origin) for emitter in emitters if is_area(emitter))
    # Shapes that stop light, and shapes that bound media. The medium of a shape that holds the
    # whole box of a density grid counts as the medium around the camera, and the shape bounds
    # nothing.
    opaque, boundaries = sorted_shapes(scene)
    grid = grid_in_a_shape(sensor, boundaries, origin)
    media = () if grid else tuple(read_bounded(shape) for shape in boundaries)
    medium = grid or read_ambient(sensor, origin, media, boundaries)
    suns = tuple(read_directional(emitter) for emitter in emitters if is_directional(emitter))
    # Light from infinity never arrives through an unbounded medium, nor along paths in height fog
    # that do not rise.
    for sun in suns if model.light_scale > 0 else ():
        name = sun.emitter.id()
        if isinstance(medium, ReferenceMedium) and np.any(medium.sigma_t > 0):
            raise InputError(
                f"light '{name}' is directional: nothing of it arrives through a medium "
                "without bounds; give the medium bounds, a closed convex shape of material 'null' "
                "with the medium as its interior"
            )
        if isinstance(medium, HeightMedium) and not -sun.direction @ medium.up > 0:
            raise InputError(
                f"light '{name}' is directional and shines from the horizon or below: each "
                "of its light paths through height fog, which has no sides, is infinitely deep; "
                "expected a light from above the horizon"
            )
    sky = _sky(background, medium)
    if background is not None and sky is None and not emitters:
        raise InputError(
            f"light '{background.id()}' is a sky: nothing of it arrives through a medium without "
            "bounds; give the medium bounds, or add a light"
        )
    if not model.is_physical and (area or sky is not None):
        wide = [emitter for emitter in emitters if is_area(emitter)] or [background]
        raise InputError(
            f"light '{wide[0].id()}' has an extent, of which the equation of a model says nothing; "
            "expected points, spots and suns: leave the model out, or take such lights"
        )
    return ReferenceScene(
        scene=scene if background is None else _rebuilt(scene, emitters),
        occluders=scene_of(opaque, scene),
        width=width,
        height=height,
        origin=origin,
        direction=film_directions(sensor, pixel_centres((width, height)), (width, height)),
        medium=_modelled(medium, model),
        lights=lights,
        media=tuple(_modelled(each, model) for each in media),
        directional=suns,
        area=area,
        background=background,
        sky=sky,
        model=model,
    )


AnyMedium = TypeVar("AnyMedium", bound=ReferenceMedium | VaryingMedium)


def _modelled(medium: AnyMedium, model: Model) -> AnyMedium:
    """Return a medium with the phase function of a model, and the albedo 1 of a lit density."""
    if model.lit_scale is not None:
        medium = replace(medium, albedo=np.ones(3))
    if model.phase in ("scene", "none"):  # `none` is one of lamps alone
        return medium
    if model.phase != "cornette-shanks":
        return replace(medium, phase=phase_from_words(model.phase))
    if not isinstance(medium.phase, HenyeyGreenstein | Isotropic):
        raise InputError(
            f"model: cornette-shanks takes the g of the scene, whose phase function is "
            f"{medium.phase.name}; expected hg or isotropic, or name another in the model"
        )
    return replace(medium, phase=CornetteShanks(getattr(medium.phase, "g", 0.0)))


def homogeneous_around(reference: ReferenceScene) -> ReferenceMedium:
    """Return the medium without bounds, if its extinction is the same everywhere.

    Raises InputError for height fog and grids.
    """
    if isinstance(reference.medium, VaryingMedium):
        raise InputError(NO_EXTINCTION)
    return reference.medium


def _background(scene: "mi.Scene") -> "mi.Emitter | None":
    """Return the emitter around a scene: a sky, or an image behind the lights of the scene."""
    # An environment map lights nothing here: it is only visible, and only in a scene with lights.
    around = [emitter for emitter in scene.emitters() if emitter.class_name() in _AROUND]
    lights = {emitter.class_name() for emitter in scene.emitters()} - set(_AROUND)
    return around[0] if around and (lights or around[0].class_name() == _AROUND[0]) else None


def _sky(background: "mi.Emitter | None", medium: ReferenceMedium | VaryingMedium) -> Array | None:
    """Return the radiance of a uniform sky whose light arrives in the media of a scene."""
    if background is None or background.class_name() != _AROUND[0]:
        return None
    if isinstance(medium, ReferenceMedium) and np.any(medium.sigma_t > 0):
        # Through an unbounded medium no light of a sky arrives; in a channel without extinction all
        # of it would, from infinitely far along each ray.
        if not np.all(medium.sigma_t > 0):
            raise InputError(
                "a sky shines through a medium without bounds in some channels; expected bounds"
            )
        return None
    return colour(
        background.eval(dr.zeros(mi.SurfaceInteraction3f)),
        f"light '{background.id()}': its radiance",
    )


def whole_scene(reference: ReferenceScene) -> "mi.Scene":
    """Return Mitsuba's scene with the sky, if it has one."""
    if reference.sky is None:
        return reference.scene
    return _rebuilt(reference.scene, [*reference.scene.emitters(), reference.background])


def _rebuilt(scene: "mi.Scene", emitters: "list[mi.Emitter]") -> "mi.Scene":
    """Return a scene with other emitters."""
    others = (each for each in emitters if not is_area(each))
    return scene_from([*scene.sensors(), *others, *scene.shapes()])


def has_mirrors(reference: ReferenceScene) -> bool:
    """Return whether an opaque shape is a mirror, which shows lights that have an extent.

    Raises InputError for one that a material mixes with others by chance.
    """
    found = False
    for shape in reference.occluders.shapes():
        bsdf = shape.bsdf()
        if not mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaReflection):
            continue
        if bsdf.class_name() == "BlendBSDF":
            raise InputError(
                f"shape '{shape.id()}' blends a mirror with another material, which shows area "
                "lights and skies in part; expected the mirror alone, or a rough one"
            )
        found = True
    return found
