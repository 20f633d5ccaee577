# SPDX-License-Identifier: BSD-3-Clause
r"""Sixteen relations between frames of single scattering, none of which needs a reference.

The airlight L of a ray, with sources I in W/sr, and a surface S behind depth tau,

    L = int sigma_s exp(-sigma_t (x + r)) p/(4 pi) I/r^2 V dx,     S = S_0 exp(-tau),

is linear in the sources and in the albedo, knows no place but those of its lights and shapes, and
belongs to a ray, not to a pixel. No relation needs a number of the scene:

- *again*: one input, one image; how far two differ is the floor of all other relations;
- *intensity*: k times the sources, k times the image, apart from light that is there without them;
  *sum*: sources add up; *black-light*: a source of no strength adds nothing; *colours*: channels do
  not mix; *exposure*: one factor for everything;
- *units*: all lengths times k, sigma / k, I times k^2, E as it is: x sigma and I/r^2 dx sigma stay;
- *moved*: the world with its camera elsewhere, turned, or mirrored;
- *pan*: a camera that turns about its own place sees the same rays, in other pixels;
- *size*: an image of twice the size has the same means over 2 x 2 pixels;
- *bounds*: fog where neither ray nor light comes changes nothing;
- *thin*: L is linear in sigma where sigma is small: L(s)/L(s/2) tends to 2. With the two ratios of
  s, s/2, s/4 the term linear in s drops out: 2 q(s/4) - q(s/2) = 1 + O(s^2), q(s) = L(2 s)/(2 L(s));
  along rays without an end a part of s log s is left, less than the term that was taken out;
- *depths-multiply*: S(s)^2 = S(s - d) S(s + d) on surfaces that one lamp lights, and background;
- *albedo*: L is linear in it, S does not know it;
- *furnace*: an ambient light c and a background c, albedo 1, no lamp: c (1 - T) + c T = c;
- *reciprocity*: with f the sensitivity of a camera over directions and g that of a spot, the sum
  of L f over directions is the same when camera and spot change places:
  int L f dw = int int f g exp(-tau - tau') p/(r^2 r'^2) dV is symmetric in both.

Metamorphic testing (Chen, Cheung, Yiu 1998; for shader compilers Donaldson 2016), for fog.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter

from airlight.errors import InputError
from airlight.validation.arrays import Array
from airlight.validation.check.check_file import Asked

AIRLIGHT, SURFACE, TOTAL = "airlight", "surface", "total"
# A mean over 2 x 2 pixels errs by a 32nd of the second differences along rows and columns, and a
# bilinear look-up by an eighth at most. The terms that follow may be as large where a horizon bends
# the image within a pixel: four and two times as much are allowed.
_MEAN, _BILINEAR = 1 / 8, 1 / 4


@dataclass(frozen=True)
class Sides:
    """Two images, (height, width, channels), that a relation says are the same."""

    got: Array
    wanted: Array
    #: by how much sampling alone parts them, pixel by pixel, in their unit
    sampling: Array | float = 0.0
    side: int = 1  #: of their pixels, in those of the frames


@dataclass(frozen=True)
class Relation:
    """A relation between frames."""

    name: str
    points_to: str  #: what is likely wrong where it fails
    sides: Callable[[Sequence[Array], Asked], Sides]
    frames: tuple[int, ...] = (2,)  #: how many it may take
    layer: str = AIRLIGHT  #: the layer that is judged where frames have layers
    alone: bool = False  #: whether it holds for that layer alone, and not for all light


def _same(frames: Sequence[Array], asked: Asked) -> Sides:
    return Sides(frames[1], frames[0])


def _scaled(frames: Sequence[Array], asked: Asked) -> Sides:
    base, brighter, *none = frames
    # Light that is there without any lamp stays as it is.
    return Sides(brighter, asked.factor * base - (asked.factor - 1) * (none[0] if none else 0.0))


def _summed(frames: Sequence[Array], asked: Asked) -> Sides:
    one, other, both, *none = frames
    # Light that is there without any lamp is in each of the three.
    return Sides(both, one + other - (none[0] if none else 0.0))


def _permuted(frames: Sequence[Array], asked: Asked) -> Sides:
    return Sides(frames[1], frames[0][..., list(asked.order)])


def _moved(frames: Sequence[Array], asked: Asked) -> Sides:
    return Sides(frames[1], frames[0][:, ::-1] if asked.mirrored else frames[0])


def _panned(frames: Sequence[Array], asked: Asked) -> Sides:
    base, panned = frames
    if len(asked.cameras) != 2:
        raise InputError("pan: expected two cameras, each with its forward direction and fov")
    first, second = asked.cameras
    height, width = panned.shape[:2]
    # Where the rays of the second image lie in the first, in pixels.
    right, down = first.pixels(second.directions(width, height), base.shape[1], base.shape[0])
    inside = (right >= 1) & (right <= base.shape[1] - 2) & (down >= 1) & (down <= base.shape[0] - 2)
    if inside.mean() < 0.1:
        raise InputError("pan: the two cameras share less than a tenth of their rays")
    looked_up = _bilinear(base, np.where(inside, right, 1.0), np.where(inside, down, 1.0))
    kept = inside[..., None]
    bend = _bilinear(_bend(base), np.where(inside, right, 1.0), np.where(inside, down, 1.0))
    return Sides(
        np.where(kept, panned, np.nan), np.where(kept, looked_up, np.nan), _BILINEAR * bend
    )


def _bilinear(image: Array, right: Array, down: Array) -> Array:
    column, row = np.floor(right).astype(int), np.floor(down).astype(int)
    a, b = (right - column)[..., None], (down - row)[..., None]
    upper = (1 - a) * image[row, column] + a * image[row, column + 1]
    lower = (1 - a) * image[row + 1, column] + a * image[row + 1, column + 1]
    return (1 - b) * upper + b * lower


def _bend(image: Array) -> Array:
    """Return the second differences along rows and columns, the largest about each pixel."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="reflect")
    middle = padded[1:-1, 1:-1]
    bends = np.abs(padded[2:, 1:-1] + padded[:-2, 1:-1] - 2 * middle)
    bends += np.abs(padded[1:-1, 2:] + padded[1:-1, :-2] - 2 * middle)
    return maximum_filter(bends, size=(3, 3, 1))


def _sized(frames: Sequence[Array], asked: Asked) -> Sides:
    coarse, fine = frames
    if fine.shape[:2] != (2 * coarse.shape[0], 2 * coarse.shape[1]):
        raise InputError(
            f"size: got frames of {coarse.shape[1]} x {coarse.shape[0]} and {fine.shape[1]} x "
            f"{fine.shape[0]}; expected the second with twice the sides of the first"
        )
    return Sides(block_means(fine, 2), coarse, _MEAN * _bend(coarse))


def _thinned(frames: Sequence[Array], asked: Asked) -> Sides:
    # Means over blocks would hide nothing here: a ratio needs light, so that it is one of sums.
    thick, middle, thin = (block_means(each, 2) for each in frames)
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = thick / (2 * middle), middle / (2 * thin)
    ratio = 2 * second - first
    lit = thin > 0.05 * thin.mean()
    # The difference of both is the term that was taken out; less is left.
    one, left = np.where(lit, 1.0, np.nan), np.where(lit, np.abs(second - first), np.nan)
    return Sides(np.where(lit, ratio, np.nan), one, left, side=2)


def block_means(values: Array, size: int) -> Array:
    """Return means over blocks; what is left at the right and below is a part of no block."""
    height, width = (side - side % size for side in values.shape[:2])
    cut = values[:height, :width]
    return cut.reshape(height // size, size, width // size, size, -1).mean(axis=(1, 3))


def _multiplied(frames: Sequence[Array], asked: Asked) -> Sides:
    clear, once, twice = frames
    return Sides(once, np.sqrt(np.maximum(clear * twice, 0.0)))


def _furnace(frames: Sequence[Array], asked: Asked) -> Sides:
    level = np.asarray(asked.value if asked.value else frames[0].mean(axis=(0, 1)))
    together = np.concatenate(list(frames), axis=1)
    return Sides(together, np.broadcast_to(level, together.shape).copy())


def _swapped(frames: Sequence[Array], asked: Asked) -> Sides:
    if len(asked.cameras) != 2 or not all(each.cone for each in asked.cameras):
        raise InputError("reciprocity: expected two cameras, each with its fov and its cone")
    sums = []
    for frame, camera in zip(frames, asked.cameras):
        height, width = frame.shape[:2]
        weight = camera.sensitivity(width, height) * camera.solid_angles(width, height)
        sums.append((frame * weight[..., None]).sum(axis=(0, 1), keepdims=True))
    # A cone that is cut into pixels: its edge is soft, and the sum errs by their squared size.
    finest = min(frame.shape[1] for frame in frames)
    return Sides(sums[1], sums[0], (12.0 / finest) ** 2 * np.abs(sums[0]))


RELATIONS: dict[str, Relation] = {
    each.name: each
    for each in (
        Relation(
            "again",
            "noise, history or dithering: all other relations are judged against it",
            _same,
            layer=TOTAL,
        ),
        Relation(
            "intensity",
            "light that is lit density (1 - exp), a tone curve, clipping, automatic exposure, or "
            "intensities that are decoded as colours",
            _scaled,
            (2, 3),
        ),
        Relation(
            "sum",
            "packed or clipped light, a limit of lights in a tile, fog that one light switches on",
            _summed,
            (3, 4),
        ),
        Relation(
            "black-light",
            "fog that grows with the number of lights",
            _same,
        ),
        Relation(
            "colours",
            "channels that mix: luminance in the place of colour, one extinction for all",
            _permuted,
        ),
        Relation(
            "units",
            "a constant in metres: a softened law, a least distance, a range, steps of a fixed length",
            _same,
        ),
        Relation(
            "moved",
            "fog that hangs on the origin or on an axis, coordinates that lose digits",
            _moved,
        ),
        Relation(
            "pan",
            "planar depth in the place of distance, fog in screen space",
            _panned,
        ),
        Relation(
            "size",
            "fog that counts pixels, laws that follow the size of a cell, upscaling",
            _sized,
        ),
        Relation(
            "bounds",
            "a light path of constant length, lights that are lost in large volumes",
            _same,
        ),
        Relation(
            "thin",
            "opacity that is applied twice (a ratio of 2 in the place of 1), a density that is squared",
            _thinned,
            (3,),
            alone=True,
        ),
        Relation(
            "depths-multiply",
            "a cap of the fog, a squared exponential, opacity applied twice",
            _multiplied,
            (3,),
            layer=SURFACE,
            alone=True,
        ),
        Relation(
            "albedo",
            "an albedo that is decoded as a colour, or that changes the extinction",
            _scaled,
            alone=True,
        ),
        Relation(
            "exposure",
            "fog that is added after the exposure, or before and after it",
            _scaled,
            layer=TOTAL,
        ),
        Relation(
            "furnace",
            "an ambient light with another transmittance than the background",
            _furnace,
            (1, 2, 3, 4),
            layer=TOTAL,
        ),
        Relation(
            "reciprocity",
            "no attenuation on the way from the light, a softened law, a constant light path",
            _swapped,
        ),
    )
}

#: Sets of relations that fail together, the first that applies: what they say of an equation.
SIGNATURES: tuple[tuple[frozenset[str], str], ...] = (
    (
        frozenset({"units", "reciprocity"}),
        "a law of distance with a constant in metres, such as 1/(r^2 + 1)",
    ),
    (
        frozenset({"bounds", "reciprocity"}),
        "a light path of constant length, such as the radius of the fog's box",
    ),
    (
        frozenset({"pan", "reciprocity"}),
        "planar depth, and no attenuation on the way from the light",
    ),
    (frozenset({"reciprocity"}), "no attenuation on the way from the light"),
    (frozenset({"thin", "depths-multiply"}), "opacity that is applied twice"),
    (frozenset({"intensity", "sum"}), "an image that is not linear in its lights"),
)
