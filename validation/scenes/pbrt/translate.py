# SPDX-License-Identifier: BSD-3-Clause
r"""A pbrt scene as the text of a Mitsuba scene, with its meshes as files.

**Left and right.** The camera of pbrt has x to the right, y up and z forward; its transform takes
the world to the camera, so that the columns of the inverse C are right, up, forward and the place
of the eye in the coordinates of the world. Mitsuba's camera has x to the left: its `to_world` is
M = C diag(-1, 1, 1, 1), which must not mirror. Where det M > 0, as after `Scale -1 1 1`, the world
is right-handed and stays as it is. Where det M < 0, the picture shows the world mirrored, as
`LookAt` alone does: all coordinates are taken times F = diag(-1, 1, 1, 1), the camera too. F M has
a positive determinant, the image of F p under it is that of p under M, and distances are the same.

**Angle of view.** `fov` is the angle across -1 to 1 of the screen, whose shorter side is that by
default, at any size; `screenwindow` says another part of the screen. Half of its width times
tan(fov/2) is the tangent of half of the horizontal angle.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from airlight.reference.scene.transforms import SAME
from airlight.validation.arrays import Array
from airlight.validation.scenes.pbrt.directives import (
    Directive,
    array,
    check_names,
    colour,
    directives,
    number,
    word,
)
from airlight.validation.scenes.pbrt.lights import light, rgb, to_world
from airlight.validation.scenes.pbrt.shapes import (
    Ball,
    Solid,
    radiance,
    reflectance,
    solid,
    written,
)
from airlight.validation.scenes.pbrt.sides import backs_are_lit
from airlight.validation.scenes.pbrt.state import Part, PbrtScene, read_parts

# Coefficients where a medium has none: pbrt-v3 takes milk [1/mm], pbrt-v4 ones.
_MEDIUM = {3: ((0.0011, 0.0024, 0.014), (2.55, 3.21, 3.77)), 4: ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))}
_SIZE = (1280, 720)  # of a film that says none
_FILM = (
    *("xresolution", "yresolution", "filename", "diagonal", "savefp16", "maxcomponentvalue"),
    *("cropwindow", "pixelbounds", "sensor", "iso", "exposuretime", "whitebalance"),
    *("scale", "maxsampleluminance"),
)
_LENS = ("focaldistance", "shutteropen", "shutterclose")  # of a pinhole at one instant: no effect


@dataclass(frozen=True)
class Translation:
    """A pbrt scene for Mitsuba."""

    xml: str  #: the scene
    notes: tuple[str, ...]  #: what was read in another form, and what pbrt shows otherwise


@dataclass(frozen=True, eq=False)
class _Camera:
    """The camera, and the world that it sees."""

    to_world: Array  #: Mitsuba's, (4, 4)
    flip: Array  #: from pbrt's world to ours, (4, 4)
    fov: float  #: angle of view [degrees]
    fov_axis: str  #: along which it is, as Mitsuba names it
    size: tuple[int, int]  #: [pixels]


def translate(path: Path, folder: Path) -> Translation:
    """Translate a pbrt file; meshes are written into a folder, which the text refers to.

    Raises InputError, by file, line and name, for what is not read.
    """
    scene = read_parts(directives(path), str(path))
    _check_media(scene)
    camera = _camera(scene)
    # Lights and shapes are named by their lines.
    taken, notes = set[str](), list[str]()
    emitters = list[str]()
    for part in scene.lights:
        xml, said = light(part, _name(part, path, taken), camera.flip, scene.version)
        emitters += xml
        notes += said
    made = [
        solid(part, _name(part, path, taken), camera.flip, folder, path.parent)
        for part in scene.shapes
    ]
    solids = [each for each in made if each is not None]
    bounds = [each for each in solids if not each.opaque]
    # Only media that are somewhere are written.
    used = dict.fromkeys(
        name
        for name in (
            scene.camera.state.outside,
            *(side for each in bounds for side in (each.interior, each.exterior)),
        )
        if name
    )
    ids = dict(zip(used, _ids(used)))
    notes += _notes(scene, camera, solids, bounds, list(used))
    parts = [
        *(_medium(scene.media[name], ids[name], scene.version) for name in used),
        _sensor(camera, ids.get(scene.camera.state.outside)),
        *emitters,
        *(written(each, ids) for each in solids),
    ]
    return Translation('<scene version="3.0.0">\n' + "\n".join(parts) + "\n</scene>\n", (*notes,))


def _name(part: Part, path: Path, taken: set[str]) -> str:
    """Return the name of a part: its kind and its line, and its file where that is included."""
    at = part.directive.at
    stem = "" if at.file == path else re.sub(r"[^\w-]", "-", at.file.stem) + "-"
    first = name = f"{stem}{part.directive.type}-line-{at.line}"
    number = 1
    while name in taken:  # several on one line, or a file that is included twice
        number += 1
        name = f"{first}-{number}"
    taken.add(name)
    return name


def _ids(names: Iterable[str]) -> Iterator[str]:
    """Yield names of media as Mitsuba and changes take them: letters, digits, - and _."""
    taken = set[str]()
    for name in names:
        made = re.sub(r"[^\w-]+", "-", name, flags=re.ASCII).strip("-") or "medium"
        while made in taken:
            made += "-2"
        taken.add(made)
        yield made


def _check_media(scene: PbrtScene) -> None:
    for part in (scene.camera, *scene.lights, *scene.shapes):
        # An interface counts for its shape alone, of the camera its outer side.
        names = [part.state.outside]
        names += [part.state.inside] if part.directive.name == "Shape" else []
        for name in names:
            if name and name not in scene.media:
                known = ", ".join(scene.media) or "none"
                raise part.directive.error(
                    f'its MediumInterface names "{name}", which is not made; expected a medium of '
                    f"MakeNamedMedium, here {known}"
                )


def _medium(directive: Directive, name: str, version: int) -> str:
    kind = word(directive, "type", "")
    if kind != "homogeneous":
        raise directive.error(f'is of type "{kind}"; expected homogeneous')
    if "preset" in directive.parameters:
        raise directive.error("preset is not read; expected sigma_a and sigma_s")
    check_names(directive, ("type", "sigma_a", "sigma_s", "scale", "g", "Le", "Lescale"))
    if np.any(colour(directive, "Le", (0.0, 0.0, 0.0), light=True)):
        raise directive.error("it emits light, Le; expected a medium that does not: remove it")
    scale, g = number(directive, "scale", 1.0), number(directive, "g", 0.0)
    if scale < 0 or not -1 < g < 1:
        raise directive.error(f"scale is {scale:g} and g {g:g}; expected 0 or more, and -1 to 1")
    absorbed, scattered = (
        scale * colour(directive, key, default)
        for key, default in zip(("sigma_a", "sigma_s"), _MEDIUM[version])
    )
    sigma_t = absorbed + scattered
    albedo = np.divide(scattered, sigma_t, out=np.zeros(3), where=sigma_t > 0)
    phase = f'<phase type="hg"><float name="g" value="{g!r}"/></phase>'
    return (
        f'<medium type="homogeneous" id={quoteattr(name)}>{rgb("sigma_t", sigma_t)}'
        f"{rgb('albedo', albedo)}{phase if g else ''}</medium>"
    )


def _size(film: Directive | None, version: int) -> tuple[int, int]:
    """Return the size of the image [pixels]; what changes its values is refused."""
    if film is None:
        return _SIZE
    if film.type not in ("rgb", "gbuffer", "image"):
        raise film.error("is not read; expected rgb")
    check_names(film, _FILM)
    size = tuple(
        number(film, name, default, "integer")
        for name, default in zip(("xresolution", "yresolution"), _SIZE)
    )
    if not all(side >= 1 and side == int(side) for side in size):
        raise film.error(f"has {size[0]:g} x {size[1]:g} pixels; expected whole numbers from 1 on")
    width, height = int(size[0]), int(size[1])
    # A radiance has no exposure and no white balance.
    exposure = number(film, "iso", 100.0) * number(film, "exposuretime", 1.0) / 100.0
    if (
        word(film, "sensor", "cie1931") != "cie1931"
        or exposure != 1
        or number(film, "whitebalance", 0.0) != 0
        or number(film, "scale", 1.0) != 1
    ):
        raise film.error(
            "its sensor, exposure or scale changes the values of pixels; expected radiance: remove "
            "sensor, iso, exposuretime, whitebalance and scale"
        )
    crop, bounds = array(film, "float", "cropwindow"), array(film, "integer", "pixelbounds")
    whole = [0, width, 0, height]
    if (crop is not None and [*crop] != [0, 1, 0, 1]) or (
        bounds is not None and [*bounds] != whole
    ):
        raise film.error("is cropped; expected the whole image: remove the crop")
    return width, height


def _camera(scene: PbrtScene) -> _Camera:
    """Return the camera in our world (see the module)."""
    directive, width_height = scene.camera.directive, _size(scene.film, scene.version)
    if directive.type != "perspective":
        raise directive.error("is not read; expected perspective")
    known = ("fov", "frameaspectratio", "screenwindow", "lensradius", *_LENS)
    check_names(directive, known)
    if number(directive, "lensradius", 0.0) != 0:
        raise directive.error("its lens has a radius; expected a pinhole: remove lensradius")
    # The place and the axes of the camera; one scale for all of them changes no ray.
    matrix = np.linalg.inv(scene.camera.state.ctm) @ np.diag([-1.0, 1.0, 1.0, 1.0])
    axes = matrix[:3, :3] / np.cbrt(abs(np.linalg.det(matrix[:3, :3])))
    printed = 1e-3  # how far axes are off a rotation in files with four digits
    is_affine = np.allclose(scene.camera.state.ctm[3], [0, 0, 0, 1])
    if not np.allclose(axes.T @ axes, np.eye(3), atol=printed) or not is_affine:
        raise directive.error(
            "its transform has several scales or a shear; expected rotations, translations and one "
            "scale"
        )
    # The nearest rotation, or mirrored rotation, is that without the singular values.
    first, _, last = np.linalg.svd(axes)
    flip = np.diag([np.sign(np.linalg.det(axes)), 1.0, 1.0, 1.0])
    placed = np.eye(4)
    placed[:3] = np.column_stack([first @ last, matrix[:3, 3]])
    return _Camera(flip @ placed, flip, *_fov(directive, *width_height), width_height)


def _fov(directive: Directive, width: int, height: int) -> tuple[float, str]:
    """Return the angle of view [degrees], and the axis along which it is."""
    given = number(directive, "frameaspectratio", 0.0)
    aspect, window = given or width / height, array(directive, "float", "screenwindow")
    usual = not given and window is None
    if window is None:
        window = np.array([-1.0, 1.0, -1.0, 1.0]) * np.repeat(
            [max(aspect, 1), max(1 / aspect, 1)], 2
        )
    if len(window) != 4 or window[1] <= window[0] or window[3] <= window[2]:
        raise directive.error("screenwindow has no four numbers that grow; expected x and y ranges")
    wide, high = window[1] - window[0], window[3] - window[2]
    off = max(abs(window[0] + window[1]) / wide, abs(window[2] + window[3]) / high)
    if off > SAME or abs(wide / high * height / width - 1) > SAME:
        raise directive.error(
            f"its screen is {wide:g} x {high:g} about another middle than the axis, or stretches "
            f"the {width} x {height} pixels; expected square pixels about the axis"
        )
    fov = number(directive, "fov", 90.0)
    if not 0 < fov < 180:
        raise directive.error(f"fov is {fov:g}; expected an angle above 0 and below 180 degrees")
    if usual:
        return fov, "smaller"
    tangent = np.tan(np.deg2rad(0.5 * fov)) * 0.5 * wide
    return float(2 * np.rad2deg(np.arctan(tangent))), "x"


def _sensor(camera: _Camera, medium: str | None) -> str:
    width, height = camera.size
    within = f'<ref name="medium" id={quoteattr(medium)}/>' if medium else ""
    # Clip planes that take nothing away from Mitsuba's own image of a usual scene.
    return (
        f'<sensor type="perspective" id="camera"><float name="fov" value="{camera.fov!r}"/>'
        f'<string name="fov_axis" value="{camera.fov_axis}"/><float name="near_clip" value="1e-5"/>'
        f'<float name="far_clip" value="1e5"/>{to_world(camera.to_world)}{within}'
        f'<film type="hdrfilm"><integer name="width" value="{width}"/>'
        f'<integer name="height" value="{height}"/></film></sensor>'
    )


def _notes(
    scene: PbrtScene,
    camera: _Camera,
    solids: Sequence[Solid],
    bounds: Sequence[Solid],
    used: Sequence[str],
) -> Iterator[str]:
    """Yield what a reader of the file must know."""
    if camera.flip[0, 0] < 0:
        yield (
            "the world of the pbrt file is left-handed: (x, y, z) in it is (-x, y, z) here, which "
            "gives the same image"
        )
    if scene.filter is not None and not _is_pixel(scene.filter):
        yield (
            f'PixelFilter "{scene.filter.type}" is not used: a pixel is one ray through its '
            "centre, or with --pixel area the mean over the pixel"
        )
    # pbrt-v4 multiplies wavelength by wavelength: a product of colours is another one there.
    if scene.version == 4 and _is_coloured(scene, solids, used):
        yield (
            "colours are multiplied as RGB; pbrt-v4 multiplies spectra, so that its own image has "
            "slightly other colours"
        )
    if named := _other_media(scene, camera, solids, bounds):
        more = f" and {len(named) - 3} more" if len(named) > 3 else ""
        yield (
            f"{', '.join(named[:3])}{more}: the MediumInterface names another medium than the one "
            "there, so that pbrt attenuates the light that leaves the surface otherwise; here the "
            "camera and the bounds say which medium is where"
        )


def _is_pixel(directive: Directive) -> bool:
    """Return whether a filter is the mean over a pixel."""
    sizes = [number(directive, name, 0.5) for name in ("xradius", "yradius", "xwidth", "ywidth")]
    return directive.type == "box" and sizes == 4 * [0.5]


def _is_coloured(scene: PbrtScene, solids: Sequence[Solid], used: Sequence[str]) -> bool:
    """Return whether a medium is coloured, or light of a colour falls on another."""
    media = [
        colour(scene.media[name], key, (1.0, 1.0, 1.0))
        for name in used
        for key in ("sigma_a", "sigma_s")
    ]
    areas = [each.part.state.area for each in solids]
    lights = [radiance(each) for each in areas if each is not None]
    for part in scene.lights:
        key = "I" if part.directive.type in ("point", "spot") else "L"
        lights.append(colour(part.directive, key, (1.0, 1.0, 1.0), light=True))
    surfaces = [reflectance(each.part.state) for each in solids if each.opaque]

    def coloured(colours: Iterable[Array]) -> bool:
        return any(np.ptp(each) > 0 for each in colours)

    return coloured(media) or (coloured(lights) and coloured(surfaces))


def _other_media(
    scene: PbrtScene, camera: _Camera, solids: Sequence[Solid], bounds: Sequence[Solid]
) -> list[str]:
    """Return the names of opaque shapes whose lit sides name another medium than the one there."""
    eye = camera.to_world[:3, 3]
    around = scene.camera.state.outside
    for each in bounds:
        around = each.exterior if each.holds(eye) else around
    # Where lights are: places of lamps, corners of area lights, directions of suns.
    places, towards, sky = list[Array](), list[Array](), False
    for part in scene.lights:
        matrix, directive = camera.flip @ part.state.ctm, part.directive
        ends = [array(directive, "point3 point", name) for name in ("from", "to")]
        start = np.zeros(3) if ends[0] is None else ends[0]
        sky |= directive.type == "infinite"
        if directive.type == "distant":
            target = np.array([0.0, 0.0, 1.0]) if ends[1] is None else ends[1]
            towards.append(matrix[:3, :3] @ (start - target))
        elif directive.type != "infinite":
            places.append((matrix @ [*start, 1.0])[:3])
    for each in solids:
        if each.part.state.area is not None and each.body is not None:
            places += [*_corners(each.body)]
    found = list[str]()
    for each in solids:
        sides = (
            _seen_sides(each, eye, np.array(places), np.array(towards), sky) if each.opaque else []
        )
        holder = next((bound for bound in bounds if bound.holds(each.sample)), None)
        there = around if holder is None else holder.interior
        if any(side != there for side in sides):
            found.append(each.name)
    return found


def _corners(body: Array | Ball) -> Array:
    """Return points of a light, which lie on both sides of a plane where the light does."""
    if isinstance(body, Ball):
        signs = np.array(np.meshgrid(*3 * [[-1.0, 1.0]])).reshape(3, -1).T
        return body.centre + body.radius * signs
    return np.unique(body.reshape(-1, 3), axis=0)


def _seen_sides(made: Solid, eye: Array, places: Array, towards: Array, sky: bool) -> list[str]:
    """Return the media of the sides of an opaque shape that may be lit and seen."""
    state = made.part.state
    # A black surface sends no light; one medium on both sides needs no question.
    if not made.visible or not np.any(reflectance(state)):
        return []
    if state.inside == state.outside:
        return [state.outside]
    if made.body is None or isinstance(made.body, Ball) or made.closed:
        return [made.exterior]
    # The front of triangles that are turned round is the back.
    lit = [
        sky or backs_are_lit(corners, eye, places.reshape(-1, 3), towards.reshape(-1, 3))
        for corners in (made.body[:, ::-1], made.body)
    ]
    return [side for side, is_lit in zip((state.outside, state.inside), lit) if is_lit]
