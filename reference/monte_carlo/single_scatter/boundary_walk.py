# SPDX-License-Identifier: BSD-3-Clause
"""Walking through the boundaries of media: optical depth and visibility between a
light and a point, in Dr.Jit.

A bounded medium is a closed shape with the material `null` that names the media on both sides; it
neither reflects nor refracts. A ray is followed from one such boundary to the next with
`ray_intersect`, and the media are the scene's own pointers. A boundary that rounding makes a ray
meet twice names the same medium both times. A segment may miss a boundary close to its end, where
the point lies in the boundary or just beneath it: the stretch in the wrong medium is then as short
as that distance. The walk follows the medium from the light on, or to a light infinitely far away
takes the one before each boundary, and never asks in which medium the point lies.

Stretches are measured along the one straight ray between the light and the point. A continued ray
starts a little beyond a boundary, so that it does not meet the boundary again; the optical depth
counts that little way too. Visibility rays stop a relative 1e-5 before the point, since a point on
a surface must not be hidden by that surface; the attenuation counts the whole distance (volpath's
does not, DESIGN section 6.1).
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from airlight.reference.scene.shape_roles import metre_of

_SHORT_OF_POINT = 1e-5  # relative: a hundred roundings of single precision


@dataclass(frozen=True)
class Surroundings:
    """The shapes that rays can meet."""

    scene: "mi.Scene"  #: of opaque shapes alone where nothing bounds a medium
    surfaces: bool  #: whether there are shapes
    bounded: bool  #: whether some of them are boundaries of media
    metre: "mi.Float"  #: 1 m, or the size of a smaller scene [m]

    @staticmethod
    def of(scene: "mi.Scene", bounded: bool) -> "Surroundings":
        """Return the shapes of a scene."""
        return Surroundings(
            scene, bool(scene.shapes()), bounded, dr.opaque(mi.Float, metre_of(scene))
        )


@dataclass(frozen=True)
class Path:
    """Straight ways of shadow rays: from a light to points of camera rays or surfaces, or from
    these to a light infinitely far away.

    Rays from afar would lose digits: a ball of 1 m, met from 200 m away, would shadow a third of
    itself. Those to a light infinitely far away have no end: a density grid may reach beyond all
    shapes, and Mitsuba does not know the box of rectangles alone.
    """

    begin: "mi.Point3f"  #: [m]
    away: "mi.Vector3f"  #: unit vectors from there
    length: "mi.Float"  #: [m]
    medium: "mi.MediumPtr | None" = None  #: where the ways begin; None: not known
    far: bool = False  #: whether they lead to a light infinitely far away
    clear: "mi.Float | float" = 0.0  #: how far off a surface, at which they begin, rays start [m]

    @staticmethod
    def to_afar(
        begin: "mi.Point3f", towards: "mi.Vector3f", clear: "mi.Float | float" = 0.0
    ) -> "Path":
        """Return the ways from points to a light infinitely far away, in unit directions."""
        length = dr.full(mi.Float, dr.largest(mi.Float), dr.width(begin))
        return Path(begin, towards, length, far=True, clear=clear)

    @property
    def ray(self) -> "tuple[mi.Point3f, mi.Vector3f, mi.Float]":
        """Origins [m], unit directions and lengths [m] of shadow rays."""
        return self.begin + self.away * self.clear, self.away, self.length


@dataclass(frozen=True)
class Segment:
    """The media at the ends of segments from a light to points."""

    start: "mi.MediumPtr"  #: at the light; the boundaries name the media that follow
    #: extinction at the points [1/m]; along all of the segment where nothing bounds a medium
    end_sigma_t: "mi.Spectrum"


def coefficients(medium: "mi.MediumPtr", active: "mi.Bool") -> "tuple[mi.Spectrum, mi.Spectrum]":
    """Return scattering and extinction of media [1/m]; 0 for a vacuum, the null pointer."""
    sigma_s, _, sigma_t = medium.get_scattering_coefficients(
        dr.zeros(mi.MediumInteraction3f), active
    )
    return sigma_s, sigma_t


def is_boundary(interaction: "mi.SurfaceInteraction3f", active: "mi.Bool") -> "mi.Bool":
    """Return where rays meet the boundary of a medium rather than a surface."""
    return active & mi.has_flag(interaction.bsdf().flags(), mi.BSDFFlags.Null)


def step_beyond(point: "mi.Point3f", metre: "mi.Float") -> "mi.Float":
    """Return how far beyond a boundary at `point` a ray goes on [m]; `metre`: see `Surroundings`."""
    # 2e-6 of the largest coordinate, and of a metre or a smaller scene, so that a step at the origin
    # has a length; media that are thinner are not seen.
    return 2e-6 * (metre + dr.max(dr.abs(point)))


def medium_at(
    around: Surroundings,
    position: "mi.Point3f",
    camera: "mi.Point3f",
    at_camera: "mi.MediumPtr",
    active: "mi.Bool",
) -> "mi.MediumPtr":
    """Return the medium at a point, such as a light, given the medium at the camera.

    The walk follows the way to the camera, through surfaces too, to the first boundary, which names
    the medium on its near side. Without a boundary both points lie in the same medium.
    """
    way = camera - position
    distance = dr.norm(way)
    direction = way / dr.maximum(distance, 1e-30)

    def walk(walking, done, medium):
        ray = mi.Ray3f(position + direction * done, direction, distance - done, 0.0, [])
        hit = around.scene.ray_intersect(ray, walking)
        met = walking & hit.is_valid()
        # A surface on the way is passed; the first boundary names the medium on the side of the
        # point.
        at_boundary = met & hit.is_medium_transition()
        medium = dr.select(at_boundary, hit.target_medium(-direction), medium)
        done = dr.select(met, done + hit.t + step_beyond(hit.p, around.metre), done)
        return met & ~at_boundary & (done < distance), done, medium

    state = (
        mi.Bool(active),
        dr.zeros(mi.Float, dr.width(distance)),
        dr.select(active, at_camera, dr.zeros(mi.MediumPtr)),
    )
    return dr.while_loop(state, lambda walking, *_: walking, walk, label="medium at a light")[-1]


def unblocked(
    around: Surroundings,
    start: "mi.Point3f",
    direction: "mi.Vector3f",
    distance: "mi.Float",
    active: "mi.Bool",
) -> "mi.Bool":
    """Return where nothing stands between the start of shadow rays and a point a little before
    their ends.
    """
    if not around.surfaces:
        return mi.Bool(True)
    return ~around.scene.ray_test(
        mi.Ray3f(start, direction, distance * (1 - _SHORT_OF_POINT), 0.0, []), active
    )


def transmittance(
    around: Surroundings,
    path: Path,
    *,
    media: Segment,
    active: "mi.Bool",
    fraction: "mi.Float | float" = 1.0,
) -> "mi.Spectrum":
    """Return the transmittance along paths; 0 where a surface is in between.

    `around`: the shapes that rays can meet; `media`: the media at both ends; `active`: mask;
    `fraction`: of the optical depth that counts.
    """
    start, direction, distance = path.begin, path.away, path.length
    if not around.bounded:
        lit = unblocked(around, *path.ray, active)
        return dr.select(lit, dr.exp(-media.end_sigma_t * distance * fraction), 0)
    reach = distance * (1 - _SHORT_OF_POINT)

    def walk(walking, lit, done, boundary, medium, depth):
        """Go to the next shape on the way: `done` is where the ray starts, `boundary` the last
        change of medium.
        """
        ray = mi.Ray3f(start + direction * done, direction, distance - done, 0.0, [])
        hit = around.scene.ray_intersect(ray, walking)
        met = walking & hit.is_valid()
        crossing = done + hit.t
        passed = is_boundary(hit, met)
        # A surface blocks the segment unless it is the one at the end of it.
        lit &= ~met | passed | (crossing > reach)
        changes = passed & hit.is_medium_transition()
        # The stretch from the last change of medium to this one. A boundary that rounding doubles
        # names the same medium again, and adds no error. On the way to a light far away each
        # boundary names the medium before it, and the last leads into vacuum.
        before = hit.target_medium(-direction) if path.far else medium
        _, sigma_t = coefficients(before, changes)
        depth = dr.select(changes, depth + sigma_t * (crossing - boundary), depth)
        boundary = dr.select(changes, crossing, boundary)
        if not path.far:
            medium = dr.select(changes, hit.target_medium(direction), medium)
        done = dr.select(passed, crossing + step_beyond(hit.p, around.metre), done)
        return passed & (done < distance), lit, done, boundary, medium, depth

    zero = dr.zeros(mi.Float, dr.width(distance))
    medium = dr.select(active, media.start, dr.zeros(mi.MediumPtr))
    state = (
        mi.Bool(active),
        mi.Bool(active),
        zero + path.clear,
        mi.Float(zero),
        medium,
        dr.zeros(mi.Spectrum, dr.width(distance)),
    )
    final = dr.while_loop(state, lambda walking, *_: walking, walk, label="segment through media")
    _, lit, _, boundary, medium, depth = final
    # The last stretch ends at the point, in the medium that the last boundary named.
    _, sigma_t = coefficients(medium, lit)
    return dr.select(lit, dr.exp((-depth - sigma_t * (distance - boundary)) * fraction), 0)
