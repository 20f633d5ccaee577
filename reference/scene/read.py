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
    PhaseFunction,
    Rayleigh,
    Tabulated,
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
from airlight.reference.scene.convex_bounds import Bounds, holds, in_surface, read_bounds
from airlight.reference.scene.directional_light import (
    DirectionalLight,
    is_directional,
    read_directional,
)
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.transforms import SAME, matrix_of, stretch
from airlight.reference.scene.varying import (
    NO_EXTINCTION,
    GridMedium,
    HeightMedium,
    VaryingMedium,
    is_grid,
    is_height_fog,
    read_grid,
    read_height_fog,
)

Array = NDArray[np.float64]

_AROUND = ("ConstantBackgroundEmitter", "EnvironmentMapEmitter")


@dataclass(frozen=True)
class ReferenceLight:
    """A point or spot light, or a point of an area light."""

    position: Array  #: [m]
    intensity: Array  #: radiant intensity on the axis [W/sr], RGB
    axis: Array | None = None  #: spot: unit vector; of a point of an area light the normal
    cutoff: float = np.pi  #: spot: half angle of the cone [rad]
    beam: float = np.pi  #: spot: half angle of full intensity [rad]
    cosine: bool = False  #: whether the intensity falls off as the cosine of the angle to the axis

    @property
    def is_soft(self) -> bool:
        """Whether the intensity falls off within the cone."""
        return self.cosine or (self.axis is not None and bool(self.beam < self.cutoff))


@dataclass(frozen=True)
class ReferenceMedium:
    """A homogeneous medium."""

    sigma_t: Array  #: extinction [1/m], RGB
    albedo: Array  #: RGB
    phase: PhaseFunction
    plugin: "mi.Medium | None"  #: None for a vacuum

    @property
    def largest(self) -> Array:
        """Its largest extinction, the same at all places, RGB [1/m]."""
        return self.sigma_t


VACUUM = ReferenceMedium(np.zeros(3), np.zeros(3), Isotropic(), None)


@dataclass(frozen=True)
class BoundedMedium(ReferenceMedium):
    """A homogeneous medium within convex bounds."""

    bounds: Bounds  #: what it fills
    name: str  #: the id of the shape that bounds it


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
    lights = tuple(_read_light(emitter) for emitter in points)
    origin = camera_matrix(sensor)[:3, 3]
    area = tuple(read_area_light(emitter, origin) for emitter in emitters if is_area(emitter))
    # Shapes that stop light, and shapes that bound media. The medium of a shape that holds the
    # whole box of a density grid counts as the medium around the camera, and the shape bounds
    # nothing.
    opaque, boundaries = sorted_shapes(scene)
    grid = _grid_in_a_shape(sensor, boundaries, origin)
    media = () if grid else tuple(_read_bounded(shape) for shape in boundaries)
    medium = grid or _read_ambient(sensor, origin, media, boundaries)
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
    """Return a scene with other emitters; all parts keep their names."""
    parts = [*scene.sensors(), *(each for each in emitters if not is_area(each)), *scene.shapes()]
    names = [part.id() for part in parts]
    # Mitsuba names the parts of a dictionary by their keys: the old names are given back.
    built = mi.load_dict(
        {"type": "scene"} | {f"part{number}": part for number, part in enumerate(parts)}
    )
    for part, name in zip(parts, names, strict=True):
        part.set_id(name)
    return built


def sorted_shapes(scene: "mi.Scene") -> "tuple[list[mi.Shape], list[mi.Shape]]":
    """Return the opaque shapes and the shapes that bound a medium; all others take no part."""
    opaque, boundaries = [], []
    for shape in scene.shapes():
        inside, outside = shape.interior_medium(), shape.exterior_medium()
        # A surface stops light; a shape of material `null` is the boundary of a medium or nothing.
        # The estimators have no third kind of shape.
        null = shape.bsdf().class_name() == "Null"
        if not null and mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Null):
            raise InputError(
                f"shape '{shape.id()}' is partly transparent; expected opaque surfaces, or "
                "material 'null'"
            )
        if not null and (inside is not None or outside is not None):
            raise InputError(
                f"shape '{shape.id()}' bounds a medium and has a {shape.bsdf().class_name()} "
                "material; expected the material 'null' on it, and no media on other shapes"
            )
        if not null:
            opaque.append(shape)
        elif inside is not None:
            boundaries.append(shape)
        elif outside is not None:
            raise InputError(
                f"shape '{shape.id()}' is a hole in a medium; expected media inside of convex "
                "bounds"
            )
    return opaque, boundaries


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


def scene_of(shapes: "list[mi.Shape]", whole: "mi.Scene") -> "mi.Scene":
    """Return a scene of some of the shapes of `whole`, or `whole` itself if these are all of its
    shapes.
    """
    return whole if len(shapes) == len(whole.shapes()) else scene_from(shapes)


def scene_from(shapes: "list[mi.Shape]") -> "mi.Scene":
    """Return a scene of some shapes, which keep their names if these can be keys of a dictionary of
    Mitsuba.
    """
    # The key of a shape becomes its name, in the whole scene too.
    names = {shape.id() for shape in shapes}
    are_keys = len(names) == len(shapes) and not any("." in name or not name for name in names)
    return mi.load_dict(
        {"type": "scene"}
        | {
            shape.id() if are_keys else f"shape{number}": shape
            for number, shape in enumerate(shapes)
        }
    )


def _read_ambient(
    sensor: "mi.Sensor",
    origin: Array,
    media: tuple[BoundedMedium, ...],
    boundaries: "list[mi.Shape]",
) -> ReferenceMedium | VaryingMedium:
    """Return the medium around all bounds; refuse a camera or a shape that names another."""
    camera_medium = sensor.get_medium()
    # The camera may be in one of the bounded media: the medium around is then the exterior of that
    # shape.
    ambient = camera_medium
    for medium, shape in zip(media, boundaries, strict=True):
        if in_surface(medium.bounds, origin):
            raise InputError(
                f"the camera is in the surface of shape '{medium.name}'; move it off, inside or "
                "outside"
            )
        if holds(medium.bounds, origin):
            if camera_medium != medium.plugin:
                raise InputError(
                    f"the camera is inside of shape '{medium.name}', but references another medium "
                    "or none; reference that shape's interior medium in the sensor"
                )
            ambient = shape.exterior_medium()
    # All bounded media lie in one and the same medium.
    for medium, shape in zip(media, boundaries, strict=True):
        if shape.exterior_medium() != ambient:
            raise InputError(
                f"the exterior medium of shape '{medium.name}' is not what surrounds the others or "
                "the camera; expected the medium that the camera references as exterior of all "
                "shapes, or none at all"
            )
    if is_height_fog(ambient) or is_grid(ambient):
        kind = "height fog" if is_height_fog(ambient) else "a density grid"
        # Height fog and grids are alone: bodies in them would need integrals of both.
        if media:
            raise InputError(
                f"shape '{media[0].name}' bounds a medium in {kind}; expected {kind} alone: remove "
                "the medium of the shape, or take a medium of type 'homogeneous' around it"
            )
        read_varying = read_height_fog if is_height_fog(ambient) else read_grid
        return read_varying(ambient, *read_scattering(ambient))
    if ambient is not None:
        return read_medium(ambient, "the medium")
    if not media:
        raise InputError(
            "the camera references no medium: it would be in a vacuum; reference the medium in the "
            "sensor"
        )
    return VACUUM


def _grid_in_a_shape(
    sensor: "mi.Sensor", boundaries: "list[mi.Shape]", origin: Array
) -> GridMedium | None:
    """Return a density grid in vacuum if the scene's only boundary holds the whole box of the grid:
    the grid ends at its box, and the boundary bounds nothing.
    """
    shape = boundaries[0] if len(boundaries) == 1 else None
    if shape is None or shape.exterior_medium() is not None or not is_grid(shape.interior_medium()):
        return None
    camera_medium, inside = sensor.get_medium(), shape.interior_medium()
    grid = read_grid(inside, *read_scattering(inside))
    low, high = (
        np.array(corner, dtype=np.float64).ravel()
        for corner in (shape.bbox().min, shape.bbox().max)
    )
    # The shape may be smaller than the box by 1e-5 of a side: its numbers are rounded. The test of
    # the bounding box is quick; the shape itself must then hold all eight corners of the grid,
    # drawn in by 1e-5 on each side.
    fraction = 1e-5
    margin = fraction * (grid.high - grid.low)
    if np.any(low > grid.low + margin) or np.any(high < grid.high - margin):
        return None
    bounds, middle = read_bounds(shape), 0.5 * (grid.low + grid.high)
    corners = np.array(np.meshgrid(*zip(grid.low, grid.high, strict=True))).reshape(3, 8).T
    if not all(
        holds(bounds, middle + (1 - 2 * fraction) * (corner - middle)) for corner in corners
    ):
        return None
    # A camera in the shape must reference the grid's medium. A camera outside may reference it,
    # since the grid is vacuum beyond its box.
    if camera_medium not in ((inside,) if holds(bounds, origin) else (None, inside)):
        raise InputError(
            f"the camera references another medium than that of shape '{shape.id()}', a density "
            "grid, or is in the shape and references none; expected that medium"
        )
    return grid


def _read_bounded(shape: "mi.Shape") -> BoundedMedium:
    inside = read_medium(shape.interior_medium(), f"the medium of shape '{shape.id()}'")
    return BoundedMedium(
        inside.sigma_t,
        inside.albedo,
        inside.phase,
        inside.plugin,
        bounds=read_bounds(shape),
        name=shape.id(),
    )


def read_medium(medium: "mi.Medium", name: str) -> ReferenceMedium:
    """Read a homogeneous medium; messages call it by `name`."""
    if is_height_fog(medium):
        raise InputError(
            f"{name} is height fog, which has no sides; expected it in the sensor, and no shape "
            "around it"
        )
    if not medium.is_homogeneous():
        raise InputError(
            f"{name} is heterogeneous; expected a medium of type 'homogeneous', or a density grid "
            "in the sensor, or one in vacuum in a convex shape that holds its whole box"
        )
    parameters = mi.traverse(medium)
    _require_constant(parameters, "sigma_t", name)
    sigma_t = np.array(parameters["sigma_t.value.value"], dtype=np.float64) * float(
        parameters["scale"]
    )
    return ReferenceMedium(
        colour(sigma_t, f"{name}: its sigma_t"), *read_scattering(medium), medium
    )


def read_scattering(medium: "mi.Medium") -> tuple[Array, PhaseFunction]:
    """Return the albedo of a medium, RGB, the same everywhere, and its phase function."""
    parameters = mi.traverse(medium)
    _require_constant(parameters, "albedo", f"medium '{medium.id()}'")
    albedo = colour(
        parameters["albedo.value.value"],
        f"medium '{medium.id()}': its albedo",
        largest=1 + 1e-6,  # rounding
    )
    return albedo, _read_phase(medium.phase_function())


def _require_constant(parameters: "mi.SceneParameters", coefficient: str, name: str) -> None:
    if f"{coefficient}.value.value" not in parameters:
        raise InputError(
            f"{name}: its {coefficient} differs from place to place; expected one number or one "
            "'rgb'"
        )


def _read_phase(phase: "mi.PhaseFunction") -> PhaseFunction:
    parameters = mi.traverse(phase)
    name = phase.class_name()
    if name == "IsotropicPhaseFunction":
        return Isotropic()
    if name == "RayleighPhaseFunction":
        return Rayleigh()
    if name == "HGPhaseFunction":
        return HenyeyGreenstein(float(parameters["g"][0]))
    if name == "TabulatedPhaseFunction":
        return Tabulated(tuple(np.array(parameters["values"]).tolist()))
    raise InputError(
        f"the phase function is a {name}; expected one of isotropic, hg, rayleigh, tabphase"
    )


def _read_light(emitter: "mi.Emitter") -> ReferenceLight:
    name = emitter.class_name()
    if name not in ("PointLight", "SpotLight"):
        word = {"ConstantBackgroundEmitter": "constant", "EnvironmentMapEmitter": "envmap"}.get(
            name, name
        )
        raise InputError(
            f"light '{emitter.id()}' of type '{word}' is the scene's only light; expected lights "
            "of type 'point', 'spot', 'directional', 'area' or 'constant'"
        )
    parameters = mi.traverse(emitter)
    matrix = matrix_of(emitter.world_transform())
    spot = name == "SpotLight"
    # With a texture its value on the axis would stand for all of the cone.
    if spot and "texture.value" not in parameters:
        raise InputError(
            f"light '{emitter.id()}' has a texture; expected one intensity: remove the texture"
        )
    if spot and stretch(matrix) - 1 > SAME:
        raise InputError(
            f"light '{emitter.id()}' has a to_world that stretches its cone, {stretch(matrix):.6g} "
            "to 1; expected one scale for all axes and no shear, which a 'rotate' brings whose "
            "axis is not of unit length: take the scale away, in a modelling program before the "
            "export"
        )
    # A spot stands at the origin of its frame and shines along its axis z; a point light has a
    # position of its own, and any axis will do.
    position = (
        matrix[:3, 3] if spot else np.array(parameters["position"], dtype=np.float64).reshape(3)
    )
    axis = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2]) if spot else np.array([0.0, 0.0, 1.0])
    # Mitsuba's own answer at a far point on the axis, where positions lose no digits that matter.
    distance = 1024.0 * max(1.0, float(np.abs(position).max()))
    interaction = dr.zeros(mi.Interaction3f)
    interaction.p = mi.Point3f(*(position + distance * axis).tolist())
    dr.make_opaque(interaction)  # one kernel for all lights of a kind
    # Irradiance times the squared distance is the intensity.
    _, arriving = emitter.sample_direction(interaction, mi.Point2f(0.5))
    intensity = _as_given(
        emitter, colour(arriving, f"light '{emitter.id()}': its intensity") * distance**2
    )
    if not spot:
        return ReferenceLight(position, intensity)
    degrees = float(parameters["cutoff_angle"][0])
    # The interval of a cone on a ray (`reference.visibility.planes`) holds below a half space.
    if not 0 < degrees < 90:
        raise InputError(
            f"light '{emitter.id()}': its cutoff_angle is {degrees:g} degrees; expected more than "
            "0 and less than 90: a wider light is a 'point' light"
        )
    cutoff = np.deg2rad(degrees)
    return ReferenceLight(
        position,
        intensity,
        axis,
        cutoff,
        min(np.deg2rad(float(parameters["beam_width"][0])), cutoff),
    )


def _as_given(emitter: "mi.Emitter", measured: Array) -> Array:
    """Return the intensity that the scene gives, if it agrees with the measured one, which is
    rounded to float32.
    """
    parameters = mi.traverse(emitter)
    if "intensity.value" not in parameters:
        return measured
    texture = (
        np.array(parameters["texture.value"], dtype=np.float64)
        if "texture.value" in parameters
        else 1.0
    )
    given = np.array(parameters["intensity.value"], dtype=np.float64) * texture
    given = colour(given, f"light '{emitter.id()}': its intensity")
    return given if np.allclose(given, measured, rtol=1e-5, atol=0) else measured
