# SPDX-License-Identifier: BSD-3-Clause
"""One-dimensional min/max mipmaps in epipolar slices: lit intervals by steps of
2^k texels of a shadow map.

All rays of an epipolar slice see the same line of the shadow map. A binary tree of the bounds along
this line, one for each slice, finds long intervals that are lit or dark as a whole (Chen, Baran,
Durand, Jarosz 2011). Airlight is computed at samples of the slices, at regular distances and at
breaks of the depth, and interpolated to the pixels (Engelhardt and Dachsbacher 2010; Yusov 2013).

Three things differ from the publications, all in favour of the method. A kernel integrates each lit
interval, with no marching. A leaf of the tree is linear instead of constant, see
`realtime.methods.epipolar.min_max_tree`. And pixels interpolate the lit fraction of the airlight
instead of the airlight: the published scenes are lit by the sun, but near a point light the
airlight varies as 1 / distance and with the phase function. A fraction lies between 0 and 1, so no
pixel between samples is brighter than without shadows.
"""

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from airlight.realtime.memory import check_memory
from airlight.realtime.methods.epipolar.min_max_tree import SliceHeights, slice_heights
from airlight.realtime.methods.epipolar.samples import (
    WORD,
    Samples,
    between_samples,
    mark_samples,
    marked_samples,
    no_value,
    sample_ray,
    spread,
)
from airlight.realtime.methods.epipolar.slices import (
    Slices,
    image_slices,
    neighbour,
    pixel_number,
    slice_coordinate,
)
from airlight.realtime.methods.epipolar.walk import sum_lit_intervals
from airlight.realtime.methods.interface.method import Method, View
from airlight.realtime.numerics.array_types import PerMetre, bytes_of
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.camera import Camera
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import LitRays
from airlight.realtime.shadow_maps.projection import light_faces
from airlight.realtime.shadow_maps.shadow_map import (
    ShadowMap,
    cast_shadow_map,
    inverse_depth,
    map_memory,
    map_size,
)

_MOST = 65536  # slices, and samples of a slice


@dataclass(frozen=True)
class EpipolarMap:
    """The state of one light."""

    shadow_map: ShadowMap
    heights: PerMetre  #: inverse planar depths at the corners of its texels [1/m]


@dataclass(frozen=True)
class MinMax(Method):
    """The airlight by one-dimensional min/max mipmaps.

    Valid for lights anywhere; the epipole may lie in the image, where the pixels next to the light
    are the least accurate. Shadows are those of the map, sampled once more along the slices.

    References
    ----------
    Chen, Baran, Durand, Jarosz 2011, *Real-time volumetric shadows using 1D min-max mipmaps*, I3D.
    Yusov 2013, *Practical implementation of light scattering effects using epipolar sampling and 1D
    min/max binary trees*, GDC.
    """

    name = "min-max"
    summary = "epipolar slices with 1D min/max trees over the shadow map; airlight interpolated between samples"
    source = "Chen, Baran, Durand, Jarosz 2011; Yusov 2013"
    prepared_from = frozenset({"geometry", "light"})

    map: int = map_size(
        512,
        "texels on a side of a face of the shadow map, and of a slice's line for an edge of the "
        "cube or the cone "
        "of a spot",
    )
    slices: int = parameter(
        0,
        "epipolar slices; 0 for half of width plus height, the published high quality",
        least=0,
        most=_MOST,
        wanted=f"up to {_MOST}, or 0 for as many as the image needs",
    )
    samples: int = parameter(
        0,
        "samples of a slice, rounded up to a multiple of 32; 0 for half of the larger side",
        least=0,
        most=_MOST,
        wanted=f"up to {_MOST}, or 0 for as many as the image needs",
    )
    step: int = parameter(
        16,
        "every N-th sample is computed, besides those at breaks of the depth",
        choices=(1, 2, 4, 8, 16, 32),
    )
    sampling: str = parameter(
        "slices",
        "interpolate, or compute every pixel in its nearest slice: then `samples` and `step` have "
        "no effect",
        choices=("slices", "pixels"),
    )

    def check(self, scene):
        """Refuse maps and slices that need more memory than the machine has."""
        if not scene.features.shadows:
            return
        map, slices, samples = self.map, self.slices, self.samples
        # The maps of all lights exist at once, each as distances and as heights. Slices are made
        # for one light after another, so the largest count.
        map_bytes = sum(2 * map_memory(light, map) for light in scene.lights)
        slice_bytes = (
            _memory_of_slices(scene.camera, light, map, slices, samples) for light in scene.lights
        )
        what = f"map: {map} texels, slices: {slices or _usual_slices(scene.camera)}"
        advice = "use a smaller map, or fewer slices"
        check_memory(
            f"{what} for {len(scene.lights)} light(s)",
            map_bytes + max(slice_bytes, default=0),
            advice,
        )

    def prepare(self, scene, light):
        """Return the shadow map of a light."""
        shadow_map = cast_shadow_map(scene.geometry, light, self.map)
        heights = inverse_depth(shadow_map)
        dr.eval(heights)
        return EpipolarMap(shadow_map, heights)

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray [W/(m^2 sr)]."""
        airlight = view.lit_by(light, kernel)
        # Nothing casts a shadow: one integral a ray is the airlight, and slices are not needed.
        if not view.features.shadows:
            return airlight.radiance(airlight.gamma(view.distance))
        camera = view.camera
        # First stage: the slices of the image and the height map with its tree in each of them.
        cut = image_slices(camera, light, self.slices or _usual_slices(camera))
        heights = slice_heights(state.shadow_map, state.heights, cut, light)
        point = camera.project(view.direction)[:2]
        # Without interpolation every pixel walks in the slice that is nearest to it.
        if self.sampling == "pixels":
            return airlight.radiance(_lit_integral(airlight, heights, _nearest(cut, point)))
        # Second stage: which samples of the slices are computed; third stage: their fractions; last
        # stage: the pixels between them.
        depth = _depth_image(cut, point, view.distance)
        samples = mark_samples(cut, depth, count=_whole_words(self.samples, camera), step=self.step)
        fractions = _sampled_fractions(view, light, kernel, samples, heights)
        return airlight.radiance(_interpolated(airlight, samples, fractions, heights, point))

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`."""
        return ("resolution", {"sampling": "pixels"}), ("map", None)


def _usual_slices(camera: Camera) -> int:
    return max(4, (camera.width + camera.height) // 2)


def _whole_words(samples: int, camera: Camera) -> int:
    """Return how many samples a slice has."""
    count = samples or max(2, camera.width, camera.height) // 2
    return (count + WORD - 1) // WORD * WORD


def _memory_of_slices(camera: Camera, light: Light, size: int, slices: int, samples: int) -> int:
    """Return about how much the slices of a light take [bytes]: per leaf its value, two
    bounds, four of the tree.
    """
    number = bytes_of(type(light.position.x))
    leaves = size if light_faces(light) == 1 else 2 * size
    lanes = _whole_words(samples, camera)
    return (slices or _usual_slices(camera)) * (number * 7 * leaves + lanes * (4 + 3 * number))


def _lit_integral(airlight: LitRays, heights: SliceHeights, number, active=True):
    """Return the integral over the lit intervals of rays, each in a slice; 0 where not `active`."""
    x0, x1 = airlight.segment(airlight.rays.distance)
    zero = airlight.nothing(dr.width(airlight.rays.distance))
    ends = x0, dr.select(active, x1, x0)
    return sum_lit_intervals(heights, number, airlight.geometry, ends, airlight.airlight, zero)


def _nearest(slices: Slices, point):
    """Return the slice that is nearest to each image point."""
    return neighbour(slices, mi.Int32(dr.floor(slice_coordinate(slices, *point) + 0.5)))


def _depth_image(slices: Slices, point, distance):
    """Return the distances row by row, in whatever order the pixels come."""
    image = dr.empty(type(distance), slices.width * slices.height)
    dr.scatter(image, distance, pixel_number(slices, *point))
    dr.eval(image)
    return image


def _sampled_fractions(view: View, light: Light, kernel, samples: Samples, heights: SliceHeights):
    """Return the lit fraction of the airlight of each marked sample, by sample."""
    # `marked` has room for every sample of every slice; its first `count` entries are filled.
    marked, count = marked_samples(samples)
    camera = view.camera
    fractions = dr.empty(type(view.lit_by(light).nothing(1)), dr.width(marked))

    def computed(lane):
        # The ray of a sample goes through its own image point, which lies between the pixels, and
        # ends at the depth of the pixel that holds the point.
        sample = dr.gather(mi.UInt32, marked, lane)
        (i, j), slice_number, depth = sample_ray(samples, sample)
        direction = dr.normalize(camera.forward + camera.left * i + camera.up * j)
        rays = view.medium.rays(view.origin, direction)
        sample_view = replace(view, **vars(rays), distance=depth)
        airlight = sample_view.lit_by(light, kernel)
        # The lit fraction: the integral over the lit intervals over the integral as if nothing cast
        # a shadow. A ray that meets no light has 0/0, and its sample the mark of no value.
        fraction = _lit_integral(airlight, heights, slice_number) / airlight.gamma(
            airlight.rays.distance
        )
        dr.scatter(
            fractions, dr.select(dr.isfinite(fraction), fraction, no_value(fraction)), sample
        )
        return lane

    lane = spread(dr.width(marked))
    # Most of the room is empty: a branch steps over it.
    dr.if_stmt(args=(lane,), cond=lane < count, true_fn=computed, false_fn=lambda lane: lane)
    dr.eval(fractions)
    return fractions


def _interpolated(airlight: LitRays, samples: Samples, fractions, heights: SliceHeights, point):
    """Return the integral of every pixel: by the fraction of the samples around it, or by a walk
    of its own where the samples do not fit.
    """
    fraction, fits = between_samples(samples, fractions, point, airlight.rays.distance)
    # All channels have to fit. In one in which the pixel's ray meets no light nothing is needed, and
    # samples may have no fraction.
    whole = airlight.gamma(airlight.rays.distance)
    fits |= whole == 0
    if dr.depth_v(fits) > 1:
        fits = dr.all(fits)
    # Next to a light, samples gather most of their airlight at other places than the pixel, and
    # where it lies on a surface they end before it, or beyond. Within 6 pixels of the light's image
    # nothing is interpolated: height over foot is the tangent of the ray's angle with the light,
    # |left| the same for one pixel.
    least_pixels = 6.0
    pixel = dr.norm(airlight.rays.camera.left)
    fits &= airlight.geometry.height > least_pixels * pixel * dr.abs(airlight.geometry.foot)
    # `~fits` masks the segments, so that pixels with an interpolated fraction do not walk.
    pixel_integral = _lit_integral(airlight, heights, _nearest(samples.slices, point), ~fits)
    return dr.select(fits, fraction * whole, pixel_integral)
