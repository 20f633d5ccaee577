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

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.scene.camera import read_camera
from realtime.scene.lights import host_position, place_and_weight
from realtime.scene.read_scene import Scene
from validation.configurations.methods import Configuration, prepared

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLERANCES = (0.002, 0.005, 0.01, 0.02, 0.05)
#: Epipolar lines, and samples on each.
LINES = ((512, 128), (1024, 64), (1024, 128), (1024, 256), (2048, 64), (2048, 128))
TILE = 4  #: side of a tile [pixels], as in `realtime.tiles.adaptive_sampling`
_DEPTHS = 1.1  # largest to least distance within a cell, likewise
_ALONG = 1e-3  # least share of the direction to the light along the view for it to have a place in the image


@dataclass(frozen=True)
class Image:
    """Airlight and distances of an image of twice the size of the one that is looked at."""

    airlight: Array  #: (2 height, 2 width, 3) [W/(m^2 sr)]
    distance: Array  #: to the surface, (2 height, 2 width), infinite where there is none [m]
    epipole: tuple[float, float]  #: column and row of the light's place [pixels of this image], also beyond its border


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
        For a scene without exactly one light without extent, and for a light beside the camera, whose epipolar lines
        do not meet in the image's plane.
    """
    if len(scene.lights) != 1 or scene.area_lights:
        count = len(scene.lights) + len(scene.area_lights)
        raise InputError(
            f"--interpolation: got a scene with {count} lights, wanted one without extent, through which all lines go"
        )
    frame = render_frame(prepared(scene, chosen))
    camera = read_camera(scene.camera)
    place, share = place_and_weight(host_position(scene.lights[0]))
    towards = place - share * camera.origin
    left, up, along = np.linalg.solve(np.stack([camera.left, camera.up, camera.forward], axis=1), towards)
    if abs(along) < _ALONG * np.linalg.norm(towards):
        raise InputError(
            "--interpolation: got a light right beside the camera, where epipolar lines are parallel; wanted one "
            "before or behind it"
        )
    epipole = 0.5 * (camera.width - 1) - left / along, 0.5 * (camera.height - 1) - up / along
    return Image(np.asarray(frame.airlight, np.float64), np.asarray(frame.distance, np.float64), epipole)


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
    """Return the cells of lines to points of the border that are equally far apart, with samples between both ends.

    A place on a line is its share of the way from the epipole to the border, or to the far border where the epipole
    lies beyond the image. Pixels whose lines do not reach the image are counted as computed.
    """
    height, width = image.distance.shape
    x0, y0 = image.epipole
    border_x, border_y = _border(np.arange(count) * 4 / count, width - 1, height - 1)
    across, upright = border_x - x0, border_y - y0
    begin = _entry(x0, y0, across, upright, width - 1, height - 1)
    share = begin[:, None] + (1 - begin[:, None]) * np.linspace(0, 1, samples)
    column, row = x0 + across[:, None] * share, y0 + upright[:, None] * share
    airlight, distance = _rays(image, np.clip(row, 0, height - 1), np.clip(column, 0, width - 1))
    reached = begin < 1 - 1e-9
    # Line 0 lies beside the last one.
    around = np.concatenate([airlight[-1:], airlight, airlight[:1]])
    bends = np.where(reached[:, None], _bends(around)[1:-1], np.inf)

    pixel_y, pixel_x = np.mgrid[0:height:2, 0:width:2].astype(float)
    aim_x, aim_y = pixel_x - x0, pixel_y - y0
    with np.errstate(divide="ignore", invalid="ignore"):
        reach_x = np.where(aim_x > 0, (width - 1 - x0) / aim_x, -x0 / aim_x)
        reach_y = np.where(aim_y > 0, (height - 1 - y0) / aim_y, -y0 / aim_y)
    reach = np.fmin(np.where(aim_x == 0, np.inf, reach_x), np.where(aim_y == 0, np.inf, reach_y))
    reached_by = np.where(np.isfinite(reach), 1 / np.maximum(reach, 1.0), 0.0)  # 0: the pixel of the epipole
    reach = np.where(np.isfinite(reach), np.maximum(reach, 1.0), 1.0)
    turn = _turn(x0 + aim_x * reach, y0 + aim_y * reach, width - 1, height - 1) / 4 * count
    first = np.floor(turn).astype(int)
    aside = turn - first
    places, weights = [], []
    for line, of_line in ((first % count, 1 - aside), ((first + 1) % count, aside)):
        way = np.clip((reached_by - begin[line]) / np.maximum(1 - begin[line], 1e-9), 0, 1) * (samples - 1)
        before = np.minimum(way.astype(int), samples - 2)
        places += [(line, before), (line, before + 1)]
        weights += [of_line * (1 - (way - before)), of_line * (way - before)]
    corners = int(np.count_nonzero(reached)) * samples
    none = np.zeros(pixel_x.shape, bool)
    return _cells((places, weights), (airlight, distance, bends), image.distance[::2, ::2], corners, none)


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


def _border(turn: Array, width: float, height: float) -> tuple[Array, Array]:
    """Return the point of the border after `turn` of its four sides: upper, right, lower and left, in [0, 4)."""
    side = turn.astype(int) % 4
    along = turn - np.floor(turn)
    x = np.choose(side, [along * width, width, (1 - along) * width, 0.0])
    y = np.choose(side, [0.0, along * height, height, (1 - along) * height])
    return x, y


def _turn(x: Array, y: Array, width: float, height: float) -> Array:
    """Return the inverse of `_border` for points on it."""
    near = 1e-9 * (width + height)
    sides = [y <= near, x >= width - near, y >= height - near]
    turns = [x / width, 1 + y / height, 2 + (width - x) / width]
    return np.clip(np.select(sides, turns, 3 + (height - y) / height), 0.0, np.nextafter(4.0, 0.0))


def _entry(x0: float, y0: float, across: Array, upright: Array, width: float, height: float) -> Array:
    """Return at which share of its way a line from the epipole enters the image: 0 where it begins there, 1 at most."""
    if 0 <= x0 <= width and 0 <= y0 <= height:
        return np.zeros(len(across))
    with np.errstate(divide="ignore", invalid="ignore"):
        enter_x = np.minimum(-x0 / across, (width - x0) / across)
        enter_y = np.minimum(-y0 / upright, (height - y0) / upright)
    enter = np.fmax(np.where(across == 0, -np.inf, enter_x), np.where(upright == 0, -np.inf, enter_y))
    return np.clip(enter, 0.0, 1.0)
