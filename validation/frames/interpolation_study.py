# SPDX-License-Identifier: BSD-3-Clause
r"""How many rays an image needs where airlight is interpolated: between corners of tiles, or along epipolar lines.

All rays in a plane with camera and light see the shadows of one section of the scene; in the image, such a plane is an
epipolar line through the light's place. Along it airlight changes slowly, across it beams have their edges. Engelhardt
and Dachsbacher 2010 therefore compute few rays on each line and many lines; their lines end at points of the image's
border that are equally far apart. What a wrapper around any method could gain is counted here, before it is built, from
one image of twice the size in each direction: its pixels of even row and column are the image, and rays on the lines
are interpolated between all of them.

Both ways have the error control of `realtime.tiles.adaptive_sampling`. A pixel lies in a cell with four corners, of a
tile, or of two lines and two samples on each. It is interpolated where, at all four corners, in both directions and all
channels, second differences are at most `tolerance` of the airlight, and pixel and corners are about equally far away;
otherwise its own ray is computed. So a way costs

    rays = corners + pixels that are not interpolated,

and errs by what the interpolated ones are wrong. Time is not measured: the rays on lines would cost more each, as they
are no 4 x 4 pixels, and the wrapper costs its own share.

Why lines may lose: airlight ends at surfaces. What bends it along a line is every edge of a surface and of a shadow on
it, and these are no sparser along lines than across.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.methods.epipolar.slices import image_slices, neighbour, slice_coordinate
from realtime.numerics.aligned import aligned_array
from realtime.scene.camera import Camera
from realtime.scene.lights import Light
from realtime.scene.read_scene import Scene
from validation.configurations.methods import Configuration, prepared

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLERANCES = (0.002, 0.005, 0.01, 0.02, 0.05)
#: Epipolar lines, and samples on each.
LINES = ((512, 128), (1024, 64), (1024, 128), (1024, 256), (2048, 64), (2048, 128))
TILE = 4  #: side of a tile [pixels], as in `realtime.tiles.adaptive_sampling`
_DEPTHS = 1.1  # largest to least distance within a cell, likewise
_SHORT = 1e-10  # square of the length below which a line is a point [pixels^2]


@dataclass(frozen=True)
class Image:
    """Airlight and distances of an image of twice the size of the one that is looked at."""

    airlight: Array  #: (2 height, 2 width, 3) [W/(m^2 sr)]
    distance: Array  #: to the surface, (2 height, 2 width), infinite where there is none [m]
    camera: Camera  #: with which it was taken
    light: Light  #: through whose place the lines go


@dataclass(frozen=True)
class Interpolated:
    """What one way needs and by how much it errs."""

    lines: int | None  #: epipolar lines; None for tiles
    samples: int | None  #: on each line
    tolerance: float
    corners: float  #: rays at corners of cells, as a share of the pixels
    computed: float  #: pixels whose own ray is computed besides, as a share
    relative_rmse: float  #: of the image to that with all rays

    @property
    def rays(self) -> float:
        """All rays, as a share of the pixels."""
        return self.corners + self.computed


def rendered(scene: Scene, chosen: Configuration) -> Image:
    """Render a scene that was loaded at twice the size.

    Parameters
    ----------
    scene
        With an even width and height.
    chosen
        The configuration of the method.

    Raises
    ------
    InputError
        For a scene without exactly one light without extent.
    """
    if len(scene.lights) != 1 or scene.area_lights:
        count = len(scene.lights) + len(scene.area_lights)
        raise InputError(
            f"--interpolation: got a scene with {count} light(s), wanted just one, and without extent: all epipolar "
            "lines go through its place"
        )
    frame = render_frame(prepared(scene, chosen))
    airlight, distance = (np.asarray(values, np.float64) for values in (frame.airlight, frame.distance))
    return Image(airlight, distance, scene.camera, scene.lights[0])


def study_interpolation(
    image: Image,
    tolerances: Sequence[float] = TOLERANCES,
    lines: Sequence[tuple[int, int]] = LINES,
) -> list[Interpolated]:
    """Return what tiles and epipolar lines need and err by, for every tolerance."""
    ways = [(None, None, _tiles(image))] + [(*each, _epipolar_lines(image, *each)) for each in lines]
    exact = image.airlight[::2, ::2]
    found = []
    for count, samples, cells in ways:
        for tolerance in tolerances:
            computed = cells.far | cells.bent(tolerance)
            shown = np.where(computed[..., None], exact, cells.interpolated)
            rmse = float(np.sqrt(np.mean((shown - exact) ** 2)) / exact.mean())
            # A pixel that is a corner itself has its ray already.
            more = np.count_nonzero(computed & ~cells.is_corner) / computed.size
            found.append(Interpolated(count, samples, tolerance, cells.corners / computed.size, more, rmse))
    return found


@dataclass(frozen=True)
class _Cells:
    """The corners of cells, and what every pixel finds in its own."""

    corners: int
    bends: Array  # least tolerance with which the cell of a pixel is interpolated, (height, width)
    far: Mask  # whether pixel and corners are not equally far away, (height, width)
    interpolated: Array  # (height, width, 3)
    is_corner: Mask  # (height, width)

    def bent(self, tolerance: float) -> Mask:
        return self.bends > tolerance


def _bends(airlight: Array) -> Array:
    """Return the second differences of a grid of corners, of both directions and all channels, by the airlight."""
    largest = np.zeros(airlight.shape[:2])
    for axis in (0, 1):
        second = np.abs(np.diff(airlight, n=2, axis=axis))
        ends = [(1, 1) if each == axis else (0, 0) for each in range(3)]
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.pad(second, ends, mode="edge") / airlight
        largest = np.maximum(largest, np.nan_to_num(relative, nan=0.0, posinf=np.inf).max(axis=-1))
    return largest


def _cells(corners: tuple, values: tuple[Array, Array, Array], pixels: Array, count: int, is_corner: Mask) -> _Cells:
    """Return what pixels find at their four corners.

    `corners` are four places in the grid with their weights, `values` airlight, distance and bends of the grid, and
    `pixels` the distances of the pixels.
    """
    airlight, distance, bends = values
    places, weights = corners
    interpolated = sum(weight[..., None] * airlight[place] for place, weight in zip(places, weights))
    apart = _apart(np.stack([pixels, *(distance[place] for place in places)]))
    return _Cells(count, np.max([bends[place] for place in places], axis=0), apart, interpolated, is_corner)


def _tiles(image: Image) -> _Cells:
    airlight, distance = image.airlight[::2, ::2], image.distance[::2, ::2]
    height, width = distance.shape
    grid = airlight[::TILE, ::TILE], distance[::TILE, ::TILE]
    row, column = np.mgrid[0:height, 0:width]
    rows, columns = grid[1].shape
    above, before = row // TILE, column // TILE
    down, right = row / TILE - above, column / TILE - before
    below, after = np.minimum(above + 1, rows - 1), np.minimum(before + 1, columns - 1)
    places = (above, before), (above, after), (below, before), (below, after)
    weights = (1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right
    is_corner = (row % TILE == 0) & (column % TILE == 0)
    cells = _cells((places, weights), (*grid, _bends(grid[0])), distance, grid[1].size, is_corner)
    # The last tiles of rows and columns have no corners on their other side.
    return replace(cells, far=cells.far | (above == rows - 1) | (before == columns - 1))


def _epipolar_lines(image: Image, count: int, samples: int) -> _Cells:
    """Return the cells of the lines that `min-max` has, with samples at equal steps from one end to the other."""
    height, width = image.distance.shape
    slices = image_slices(image.camera, image.light, count)
    # Ends and pixels are points to the left of and above the middle of the image.
    ends = np.array(slices.ends, np.float64).reshape(count, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    points = ends[:, None, 0] + np.linspace(0, 1, samples)[:, None] * along[:, None]
    column, row = 0.5 * (width - 1) - points[..., 0], 0.5 * (height - 1) - points[..., 1]
    airlight, distance = _rays(image, np.clip(row, 0, height - 1), np.clip(column, 0, width - 1))
    if slices.closed[0]:
        bends = _bends(np.concatenate([airlight[-1:], airlight, airlight[:1]]))[1:-1]
    else:
        bends = _bends(airlight)

    row, column = np.mgrid[0:height:2, 0:width:2]
    pixel = np.stack([0.5 * (width - 1) - column, 0.5 * (height - 1) - row], axis=-1)
    Float = type(slices.ends)
    coordinate = slice_coordinate(slices, *(aligned_array(Float, pixel[..., axis].ravel()) for axis in (0, 1)))
    low = dr.floor(coordinate)
    aside = np.array(coordinate - low, np.float64).reshape(row.shape)
    places, weights = [], []
    for step, of_line in ((0, 1 - aside), (1, aside)):
        line = np.array(neighbour(slices, mi.Int32(low) + step)).reshape(row.shape)
        length = np.maximum(np.sum(along[line] ** 2, axis=-1), _SHORT)
        way = np.sum((pixel - ends[line, 0]) * along[line], axis=-1) * (samples - 1) / length
        way = np.clip(way, 0, samples - 1)
        before = np.minimum(way.astype(int), samples - 2)
        places += [(line, before), (line, before + 1)]
        weights += [of_line * (1 - (way - before)), of_line * (way - before)]
    none = np.zeros(row.shape, bool)
    return _cells((places, weights), (airlight, distance, bends), image.distance[::2, ::2], count * samples, none)


def _rays(image: Image, row: Array, column: Array) -> tuple[Array, Array]:
    """Return airlight and distance at places between pixels: linear between these, or of the nearest at an edge."""
    height, width = image.distance.shape
    above, before = np.minimum(row.astype(int), height - 2), np.minimum(column.astype(int), width - 2)
    down, right = row - above, column - before
    airlight, distances = np.zeros((*row.shape, 3)), []
    for below, lower in ((0, 1 - down), (1, down)):
        for after, later in ((0, 1 - right), (1, right)):
            place = above + below, before + after
            airlight += (lower * later)[..., None] * image.airlight[place]
            distances.append(image.distance[place])
    nearest = np.rint(row).astype(int), np.rint(column).astype(int)
    apart = _apart(np.stack(distances))
    return np.where(apart[..., None], image.airlight[nearest], airlight), image.distance[nearest]


def _apart(distances: Array) -> Mask:
    """Return where distances, along the first axis, are not about equal."""
    nearest, farthest = distances.min(axis=0), distances.max(axis=0)
    return ~((farthest <= _DEPTHS * nearest) | np.isinf(nearest))
