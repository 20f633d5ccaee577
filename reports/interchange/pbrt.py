# SPDX-License-Identifier: BSD-3-Clause
"""A scene as a file of pbrt-v4 that has everything in it: camera, lights, media and meshes.

pbrt looks along z with y up and x to the right; `Scale -1 1 1` before `LookAt` makes its world
right-handed, so that every coordinate of the file is the coordinate of the scene. Colours are `rgb`
values: pbrt's light of `rgb L` has that radiance in a film of linear sRGB, whose sensor is
`cie1931` by default. `maxdepth` 1 ends a path after one scattering or one reflection, as a reference
does. All shapes but the bounds of media name the medium where they stand on both sides, since a
pbrt ray takes the medium of the side on which it leaves a surface.

A spot of pbrt falls off as a smooth step of the cosine, and ours linearly in the angle: only spots
with a hard edge are written. pbrt has Henyey and Greenstein's phase function alone, and no fog by
height; its grids are not written.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.analytic.phase import HenyeyGreenstein, Isotropic
from airlight.errors import InputError
from airlight.reference.scene.area_light import ReferenceAreaLight
from airlight.reference.scene.camera import camera_matrix
from airlight.reference.scene.convex_bounds import Polyhedron, holds
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.transforms import matrix_of
from airlight.reference.scene.varying import VaryingMedium
from airlight.reference.storage.build import build
from airlight.reports.interchange.cut import cut_by
from airlight.reports.interchange.meshes import ShapeMesh, shape_mesh
from airlight.reports.interchange.scene import describe_scene, scene_as_it_is, surface
from airlight.validation.scenes.loading import LoadedScene
from airlight.validation.scenes.pbrt.sides import backs_are_lit, is_closed

Array = NDArray[np.float64]


def pbrt_scene(loaded: LoadedScene) -> str:
    """Return the text of a scene for pbrt-v4; its meshes stand in it.

    Raises InputError where pbrt cannot render it as it is, with the name of what is in the way.
    """
    if not loaded.model.is_physical:
        raise InputError(
            f"pbrt: the scene names the equation of {loaded.model.title}, and pbrt solves that of "
            "physics; expected a scene without a model: leave the model out"
        )
    described, scene = describe_scene(loaded), scene_as_it_is(loaded)
    around = _around(scene)
    # The camera of pbrt is in the medium outside of the interface that holds where it stands.
    media = {medium.name: f"in {medium.name}" for medium in scene.media}
    plugin = loaded.scene.sensors()[0].get_medium()
    held = [media[each.name] for each in scene.media if each.plugin == plugin]
    lines = [
        f"# {loaded.name}: written by airlight {build().words} for pbrt-v4.",
        "# Lengths in metres, radiance in W/(m^2 sr). One scattering or one reflection (maxdepth).",
        "",
        *([_medium(around, scene.medium)] if around else []),
        *(_medium(media[each.name], each) for each in scene.media),
        f'MediumInterface "" "{held[0] if held else around}"',
        "",
        *_camera(loaded, described),
        "",
        "WorldBegin",
        f'MediumInterface "{around}" "{around}"',
        "",
        *_lights(scene),
        *(line for area in scene.area for line in _area(area, around, scene)),
        *_surfaces(scene, around),
    ]
    bounds = {shape.id(): shape for shape in loaded.scene.shapes()}
    for each in scene.media:
        inner = f'MediumInterface "{media[each.name]}" "{around}"'
        lines += _shape(bounds[each.name], [inner, 'Material "interface"'])
    return "\n".join(lines) + "\n"


def _around(scene: ReferenceScene) -> str:
    """Return the name of the medium around everything, nothing for vacuum."""
    if isinstance(scene.medium, VaryingMedium):
        raise InputError(
            "pbrt: the medium has an extinction that differs from place to place, which is not "
            "written for pbrt; expected a medium of type 'homogeneous'"
        )
    return "fog" if scene.medium.plugin is not None else ""


def _medium(name: str, medium: ReferenceMedium | VaryingMedium) -> str:
    if isinstance(medium.phase, HenyeyGreenstein):
        g = medium.phase.g
    elif isinstance(medium.phase, Isotropic):
        g = 0.0
    else:
        raise InputError(
            f"pbrt: the medium '{name}' has the phase function {medium.phase.name}, which pbrt "
            "lacks; expected hg or isotropic"
        )
    scattered, absorbed = medium.albedo * medium.sigma_t, (1 - medium.albedo) * medium.sigma_t
    return (
        f'MakeNamedMedium "{name}" "string type" "homogeneous" "rgb sigma_s" [{_words(scattered)}] '
        f'"rgb sigma_a" [{_words(np.maximum(absorbed, 0.0))}] "float g" {_words(g)}'
    )


def _camera(loaded: LoadedScene, described: dict[str, Any]) -> Iterator[str]:
    width, height = described["camera"]["size"]
    matrix = camera_matrix(loaded.scene.sensors()[0])
    origin, forward, up = matrix[:3, 3], matrix[:3, 2], matrix[:3, 1]
    # pbrt's fov is the angle across the shorter side of the image.
    tangent = np.tan(np.deg2rad(0.5 * described["camera"]["fov_horizontal"]))
    fov = 2 * np.rad2deg(np.arctan(tangent * min(1.0, height / width)))
    yield "Scale -1 1 1"
    yield f"LookAt {_words(origin)}  {_words(_target(origin, forward))}  {_words(up)}"
    yield f'Camera "perspective" "float fov" {_words(fov)}'
    yield (
        f'Film "rgb" "string filename" "{described["file"]["name"]}" "bool savefp16" false '
        f'"integer xresolution" {width} "integer yresolution" {height}'
    )
    yield 'PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5'
    yield 'Sampler "zsobol" "integer pixelsamples" 256'
    yield 'Integrator "volpath" "integer maxdepth" 1'


def _target(origin: Array, direction: Array) -> Array:
    """Return a point in a direction, as far away as keeps its digits: pbrt subtracts both."""
    return np.asarray(origin + max(1.0, float(np.abs(origin).max())) * direction)


def _lights(scene: ReferenceScene) -> Iterator[str]:
    for light in scene.lights:
        yield _light(light)
    for sun in scene.directional:
        # The light comes from `from`; any distance does.
        yield (
            f'LightSource "distant" "rgb L" [{_words(sun.irradiance)}] "point3 from" '
            f'[{_words(-sun.direction)}] "point3 to" [0 0 0]'
        )
    if scene.background is not None:
        if scene.sky is None:
            raise InputError(
                f"pbrt: light '{scene.background.id()}' is seen behind the scene and lights "
                "nothing, which pbrt cannot do; expected a sky whose light arrives: remove it"
            )
        yield f'LightSource "infinite" "rgb L" [{_words(scene.sky)}]'
    yield ""


def _light(light: ReferenceLight) -> str:
    colour, place = _words(light.intensity), _words(light.position)
    if light.axis is None:
        return f'LightSource "point" "rgb I" [{colour}] "point3 from" [{place}]'
    if light.is_soft:
        beam, cutoff = (f"{np.rad2deg(angle):.4g}" for angle in (light.beam, light.cutoff))
        raise InputError(
            f"pbrt: a spot falls off linearly in the angle from {beam} to {cutoff} degrees, and "
            "pbrt's as a smooth step of the cosine; expected a hard edge: set its beam_width to "
            "its cutoff_angle"
        )
    return (
        f'LightSource "spot" "rgb I" [{colour}] "point3 from" [{place}] "point3 to" '
        f'[{_words(_target(light.position, light.axis))}] "float coneangle" '
        f'{_words(np.rad2deg(light.cutoff))} "float conedeltaangle" 0'
    )


def _area(light: ReferenceAreaLight, around: str, scene: ReferenceScene) -> list[str]:
    emission = f'AreaLightSource "diffuse" "rgb L" [{_words(light.radiance)}]'
    # A light that blocks nothing has an alpha of 0: pbrt samples it, and no ray meets it.
    material = _material(light.shape) if light.opaque else 'Material "diffuse" "rgb reflectance" 0'
    if not light.opaque:
        return _shape(light.shape, [material, emission], ' "float alpha" 0')
    return _in_medium(light.shape, [material, emission], around, scene)


def _surfaces(scene: ReferenceScene, around: str) -> Iterator[str]:
    places = np.array([light.position for light in scene.lights]).reshape(-1, 3)
    places = np.concatenate([places, *(_places(light) for light in scene.area)])
    towards = np.array([-sun.direction for sun in scene.directional]).reshape(-1, 3)
    for shape in scene.occluders.shapes():
        if shape.is_emitter():
            continue
        # pbrt's surfaces reflect on both sides.
        if not surface(shape)["two_sided"] and not _is_round(shape):
            corners = (mesh := shape_mesh(shape)).vertices[mesh.faces]
            lit = scene.sky is not None or backs_are_lit(corners, scene.origin, places, towards)
            if lit and not is_closed(corners):
                raise InputError(
                    f"pbrt: shape '{shape.id()}' reflects on one side, and its back is lit and "
                    "seen; expected a material of type 'twosided', or no light behind it"
                )
        yield from _in_medium(shape, [_material(shape)], around, scene)


def _in_medium(shape: Any, state: Sequence[str], around: str, scene: ReferenceScene) -> list[str]:
    """Return the lines of an opaque shape with the medium where it stands.

    A mesh that passes through the bounds of a medium is cut there: pbrt takes one medium for light
    that leaves a triangle.
    """
    if not scene.media:
        return _shape(shape, state)
    lines = list[str]()
    rest = None if shape.class_name() in ("Sphere", "Disk") else shape_mesh(shape)
    for medium in scene.media:
        inner = [*state, f'MediumInterface "in {medium.name}" "in {medium.name}"']
        if rest is not None and isinstance(medium.bounds, Polyhedron):
            part, rest = cut_by(rest, medium.bounds)
            lines += _shape(shape, inner, mesh=part) if len(part.faces) else []
            continue
        # The extreme points of a round shape, or all vertices in a sphere.
        points = _extremes(shape) if rest is None else rest.vertices
        held = [holds(medium.bounds, point) for point in points]
        if all(held):
            return lines + _shape(shape, inner)
        if any(held):
            raise InputError(
                f"pbrt: shape '{shape.id()}' passes through the bound of the medium of "
                f"'{medium.name}', and pbrt takes one medium for light that leaves it; expected "
                "the shape on one side: cut it there"
            )
    if rest is None or len(rest.faces):
        lines += _shape(shape, state, mesh=rest)
    return lines


def _extremes(shape: Any) -> Array:
    """Return the middles of the faces of a shape's box, (6, 3) [m]."""
    box = np.array([np.ravel(shape.bbox().min), np.ravel(shape.bbox().max)], dtype=np.float64)
    return np.asarray(
        box.mean(axis=0) + 0.5 * np.ptp(box, axis=0) * np.concatenate([np.eye(3), -np.eye(3)])
    )


def _places(light: ReferenceAreaLight) -> Array:
    """Return points of a light that lie on both sides of a plane where the light does, (n, 3)."""
    if light.kind == "mesh":
        return light.triangles.reshape(-1, 3)
    signs = np.array(np.meshgrid(*3 * [[-1.0, 1.0]])).reshape(3, -1).T
    return light.centre + light.radius * signs


def _is_round(shape: Any) -> bool:
    return bool(shape.class_name() == "Sphere")


def _material(shape: Any) -> str:
    """Return the diffuse material of a shape; others are refused by name."""
    look = surface(shape)
    if look["textured"] or not look["diffuse"]:
        what = "a texture" if look["textured"] else f"the material {shape.bsdf().class_name()}"
        raise InputError(
            f"pbrt: shape '{shape.id()}' has {what}; expected a diffuse material of one colour"
        )
    return f'Material "diffuse" "rgb reflectance" [{_words(look["reflectance"])}]'


def _shape(
    shape: Any, state: Sequence[str], alpha: str = "", mesh: ShapeMesh | None = None
) -> list[str]:
    """Return the lines of a shape in a state of its own; `mesh` is a part of it."""
    kind = shape.class_name()
    if kind in ("Sphere", "Disk"):
        matrix = matrix_of(_parameters(shape)["to_world"])
        body = [*_placed(shape, matrix), _round(kind, matrix) + alpha]
    else:
        mesh = shape_mesh(shape) if mesh is None else mesh
        if not mesh.exact:
            raise InputError(
                f"pbrt: shape '{shape.id()}' is a {kind.lower()}; expected meshes, rectangles, "
                "spheres and disks: replace it by a mesh"
            )
        body = [_mesh(mesh) + alpha]
    lines = [f"AttributeBegin  # {shape.id()}", *(f"  {line}" for line in (*state, *body))]
    return [*lines, "AttributeEnd", ""]


def _parameters(shape: Any) -> Any:
    import mitsuba as mi

    return mi.traverse(shape)


def _round(kind: str, matrix: Array) -> str:
    return f'Shape "{kind.lower()}" "float radius" {_words(np.linalg.norm(matrix[:3, 0]))}'


def _placed(shape: Any, matrix: Array) -> list[str]:
    """Return the transform of a sphere or a disk: a rotation and a translation."""
    if shape.class_name() == "Sphere":
        return [f"Translate {_words(matrix[:3, 3])}"]
    # The disk faces along its z: where the normals are flipped, along the other way.
    sign = -1.0 if shape.has_flipped_normals() else 1.0
    normal = sign * np.linalg.inv(matrix[:3, :3])[2]
    normal /= np.linalg.norm(normal)
    across = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
    across /= np.linalg.norm(across)
    frame = np.eye(4)
    frame[:3] = np.column_stack([across, np.cross(normal, across), normal, matrix[:3, 3]])
    # pbrt lists a matrix column by column.
    return [f"ConcatTransform [{_words(frame.T)}]"]


def _mesh(mesh: ShapeMesh) -> str:
    faces = " ".join(map(str, mesh.faces.reshape(-1).tolist()))
    words = f'Shape "trianglemesh" "integer indices" [{faces}] "point3 P" [{_words(mesh.vertices)}]'
    return words if mesh.normals is None else f'{words} "normal N" [{_words(mesh.normals)}]'


def _words(values: ArrayLike) -> str:
    """Return numbers with the nine digits that tell all float32 numbers apart."""
    return " ".join(f"{value + 0.0:.9g}" for value in np.asarray(values, dtype=float).ravel())
