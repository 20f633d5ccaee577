# SPDX-License-Identifier: BSD-3-Clause
r"""Shadow planes by narrow wedges of azimuth, in order: for silhouettes that are finer than tiles.

A tile of 4 x 4 pixels draws the planes that any of its rays may cross (`realtime.methods.shadow_planes.tile_lists`).
Where planes span less azimuth than a tile does, most of them concern few of its rays, and lists grow with the number
of silhouette edges although what a ray crosses does not. A *wedge* is a range of azimuths about the axis, narrower than
most planes: its list holds the planes at its azimuths and few others, whichever tile asks, so that nothing is drawn for
a frame.

**Order.** In a half plane of one azimuth phi all rays cross planes in one order, that of the angle psi
(`realtime.methods.shadow_planes.plane_table`), hence of c = A cos(phi) + B sin(phi), from large to small (w = 0: P and
Q). A wedge is in the order of its middle; where that is wrong for a ray the walk notices.

**End.** With (w_x, w_y) = sin g (cos phi, sin phi) a plane is crossed at D/x = c sin g - cos g, so before the ray ends
at x_end only if

    c > (D/x_end + cos g)/sin g          (w = 0: c > 1/(x_end sin g)).

Over a wedge of the angle d, c = R cos(phi - phi_0) is at most the larger of its values at both ends, over cos(d) where
that is positive: phi_0 may lie between them. The largest such bound of an entry and all behind it falls along the list;
where it falls below what a ray asks for, a search by halves says, and there the list ends for the ray.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.methods.shadow_planes.plane_entries import BINS, FIRST, FULL, ROOM, Source, entry_words, in_bins
from realtime.numerics.diamond_angle import TURN, host_direction

Array = NDArray[np.float64]

_FINE = 4  #: wedges that a plane spans on average: lists are a quarter longer than what is at an azimuth
_LEAST, _MOST = 1 << 6, 1 << 16  #: wedges
# Measured at 800 x 600 on a busy machine, tiles against wedges: with 2.0 times the planes of an azimuth 204 to 232 ms
# (`hall`), with 3.2 and 5.5 times 572 to 192 and 9887 to 221 ms (bumpy spheres, 82 and 328 thousand triangles).
_TIMES, _MANY = 3, 4
_SLACK = 1e-5  # of the terms of a sum: float32 rounding, with room to spare


@dataclass(frozen=True)
class Wedges:
    """The planes of a light by wedges of azimuth; Dr.Jit arrays."""

    start: Any  #: first place in `entries` of every wedge, and the end of the last
    entries: Any  #: the planes of wedge after wedge, as those of `PlaneIndex`
    bounds: Any  #: the largest c of an entry and of those behind it in its wedge
    scale: Any  #: wedges in a unit of azimuth
    w: int  #: last coordinate of the light's homogeneous position
    by_wedge = True  #: `FULL` says of an entry that the plane is at all azimuths of the wedge, and no more

    def of_rays(self, tile, azimuth, way, ray_end):
        """Return which entries rays have to look at, and that they are in order.

        Parameters
        ----------
        tile
            Not needed here.
        azimuth, way
            Of the rays: diamond angle, and unit direction in the frame, three arrays.
        ray_end
            D/x at the end of each; w = 0: 1/x.
        """
        x, y, z = way
        wedge = mi.UInt32(azimuth * self.scale)
        first, last = (dr.gather(mi.UInt32, self.start, wedge + step) for step in (0, 1))
        asked = dr.fma(-_SLACK, ray_end + 1, ray_end + z) if self.w else ray_end
        asked *= dr.rsqrt(dr.fma(x, x, y * y))

        def halve(low, high):
            middle = (low + high) >> 1
            more = dr.gather(type(x), self.bounds, middle) > asked
            return dr.select(more, middle + 1, low), dr.select(more, high, middle)

        low, _ = dr.while_loop(
            state=(first, +last), cond=lambda low, high: low < high, body=halve, labels=("low", "high")
        )
        return Source(first, low - first, low), mi.Bool(True)


def wedges_pay(start: NDArray[np.uint32], entries: NDArray[np.uint32], azimuth: Array, width: Array) -> bool:
    """Return whether wedges are to serve a frame and not lists of tiles.

    Tiles draw planes by where they are along a ray too, which wedges do not: those they beat where a tile's azimuths
    hold several times the planes that are at one azimuth, or more than the lists of tiles have room for.

    Parameters
    ----------
    start, entries
        The planes by bins of azimuth, see `realtime.methods.shadow_planes.plane_table.binned`.
    azimuth, width
        Of some tiles of the image, diamond angles.
    """
    if not len(azimuth):
        return False
    ends = start[: BINS + 1].astype(np.int64)
    first_marks = np.cumsum(np.append(0, (entries[: ends[-1]] & FIRST) != 0))
    all_planes, begins = np.diff(ends), np.diff(first_marks[ends])
    bins = np.minimum((azimuth * (BINS / TURN)).astype(np.int64), BINS - 1)
    at_azimuth = (all_planes - begins)[bins]  # the mean over the bin: a plane ends in as many as it begins in
    of_tile = at_azimuth + begins[bins] * width * (BINS / TURN)
    planes_at, planes_of = float(np.mean(at_azimuth)), float(np.mean(of_tile))
    return planes_of > max(ROOM, min(_TIMES * planes_at, _MANY * ROOM))


def wedge_lists(planes, *, order: str):
    """Return first places, entries, bounds and scale of the wedges of planes, as of `Wedges`, in NumPy.

    Parameters
    ----------
    planes
        From `realtime.methods.shadow_planes.plane_table`, none across azimuth 0.
    order
        'paper': towards the camera by the cosine of the middle of the edge; 'exact' and 'none': as rays cross them.
    """
    span = np.minimum(planes.last, TURN) - np.maximum(planes.first, 0)
    count = int(np.clip(2 ** np.ceil(np.log2(_FINE * TURN / np.mean(span))), _LEAST, _MOST)) if len(span) else _LEAST
    scale = np.float32(count / TURN)
    plane, wedge, _ = in_bins(planes.first, planes.last, count)
    middle, low, high = (host_direction((wedge + step) / float(scale)) for step in (0.5, 0.0, 1.0))
    forms = planes.lines[plane, :2]
    key = -planes.centre[plane] if order == "paper" else np.sum(forms * middle, axis=1)
    place = np.lexsort((-key, wedge))
    bound = np.maximum(np.sum(forms * low, axis=1), np.sum(forms * high, axis=1))
    bound = np.where(bound > 0, bound / np.sum(low * high, axis=1), bound)
    bound += _SLACK * np.sum(np.abs(forms * middle), axis=1)
    start = np.concatenate([[0], np.cumsum(np.bincount(wedge, minlength=count))])
    bound = _largest_behind(bound[place], start)
    holds = (planes.first[plane] * scale <= wedge) & (planes.last[plane] * scale >= wedge + 1)
    entries = entry_words(plane, planes.gain, FULL * holds)
    return start.astype(np.uint32), entries[place], bound, scale


def _largest_behind(values: Array, start: NDArray[np.int64]) -> Array:
    """Return of each value of a run the largest of it and those behind it; `start` is where runs begin."""
    # Runs one after another, from the last: a number that grows by more than the values from run to run parts them.
    run = np.repeat(np.arange(len(start) - 1), np.diff(start))
    order = np.argsort(values)
    rank = np.empty(len(values), dtype=np.int64)
    rank[order] = np.arange(len(values))
    largest = np.maximum.accumulate((rank - run * len(values))[::-1])[::-1] + run * len(values)
    return values[order[largest]]
