# SPDX-License-Identifier: BSD-3-Clause
"""Smooth pieces of lit intervals in scenes with bounded media.

A piece lies inside of one medium, and the segment from the light passes no corner of a body while
the point moves along it (`reference.quadrature.segments`); nor does the scattering angle pass a
kink of a tabulated phase function.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.segments import AMBIENT, Segments, depth_through_media
from airlight.reference.quadrature.stretches import Stretches
from airlight.reference.scene.read import ReferenceMedium, ReferenceScene, homogeneous_around
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Kinks = tuple[Index, Array]  # rays, and distances along them [m]


def medium_of(reference: ReferenceScene, number: int) -> ReferenceMedium:
    """Return the medium of this number."""
    return homogeneous_around(reference) if number == AMBIENT else reference.media[number]


def by_medium(reference: ReferenceScene, name: str, numbers: Index) -> Array:
    """Return a property of the media of these numbers, (n, 3)."""
    media = (*reference.media, reference.medium)  # AMBIENT is the last
    return np.stack([getattr(medium, name) for medium in media])[numbers]


@dataclass(frozen=True)
class Pieces:
    """Smooth pieces of rays, each in one medium."""

    ray: Index  #: number of the ray, (n,)
    medium: Index  #: number in `ReferenceScene.media`, or `AMBIENT`, (n,)
    x0: Array  #: distance from the camera where the piece begins, (n,) [m]
    x1: Array  #: where it ends, (n,) [m]
    first: NDArray[np.bool_]  #: whether it begins where a lit interval does, (n,)
    last: NDArray[np.bool_]  #: whether it ends where a lit interval does, (n,)
    depth: Array  #: optical depth between camera and x0, (n, 3) [1]
    #: number of the part of a lit interval in one medium that the piece was cut from, (n,)
    part: Index

    def __getitem__(self, rows) -> "Pieces":
        return Pieces(*(getattr(self, f.name)[rows] for f in fields(self)))


def cut_pieces(
    reference: ReferenceScene, rays: Rays, segments: Segments, lit: Stretches, kinks: Kinks
) -> Pieces:
    """Cut lit stretches at the bounds of media and at every kink of the integrand.

    `reference`, `rays`, `segments`: the scene, the rays, and the media along them; `lit`: rays,
    (stretches,), and distances of both ends, (stretches,) each [m]; `kinks`: rays and distances of
    the kinks, (kinks,) each [m], in any order.
    """
    parts = _parts(reference, rays, segments, *lit)
    if not len(parts.ray):  # of a batch of rays none is lit within the media
        return parts
    # tau_camera grows linearly on a part, which lies in one medium: from the camera to the part
    # once, then by sigma_t times the distance into it.
    before = depth_through_media(
        reference, rays.origin, rays.direction[parts.ray], np.zeros(len(parts.ray)), parts.x0
    )
    pieces = cut(parts, kinks)
    into = (pieces.x0 - parts.x0[pieces.part])[:, None]
    return replace(
        pieces, depth=before[pieces.part] + into * by_medium(reference, "sigma_t", pieces.medium)
    )


def whole(lit: Stretches) -> Pieces:
    """Return lit stretches as pieces of one medium, by ray and distance, for `cut`."""
    order = np.lexsort((lit[1], lit[0]))
    ray, x0, x1 = lit[0][order], lit[1][order], lit[2][order]
    medium, every = np.full(len(ray), AMBIENT), np.ones(len(ray), bool)
    return Pieces(
        ray, medium, x0, x1, every, np.isfinite(x1), np.zeros((len(ray), 3)), np.arange(len(ray))
    )


def _parts(
    reference: ReferenceScene, rays: Rays, segments: Segments, ray: Index, x0: Array, x1: Array
) -> Pieces:
    """Return the parts of lit intervals in each medium, by ray and distance."""
    parts = []
    for start, end, medium in zip(segments.start, segments.end, segments.medium):
        low, high = np.maximum(x0, start[ray]), np.minimum(x1, end[ray])
        # One slot of all rays at a time: the part of each stretch that lies in this slot's medium.
        keep = high > low
        rows, low, high = ray[keep], low[keep], high[keep]
        parts.append(
            (rows, medium[rows], low, high, low == x0[keep], (high == x1[keep]) & np.isfinite(high))
        )
    ray, number, low, high, first, last = (np.concatenate(column) for column in zip(*parts))
    if np.any(np.isinf(high)):
        # Only the medium around the bodies is unbounded, and it has a piece only where it scatters.
        # It is cut where exp underflows: an optical depth of 745 behind its beginning or the
        # light's foot.
        sigma_t = reference.medium.sigma_t
        reach = np.maximum(low, rays.foot[ray]) + 745.0 / sigma_t[sigma_t > 0].min()
        high = np.where(np.isinf(high), reach, high)
    order = np.lexsort((low, ray))
    return Pieces(
        ray, number, low, high, first, last, np.zeros((len(ray), 3)), np.arange(len(ray))
    )[order]


def cut(parts: Pieces, kinks: Kinks) -> Pieces:
    """Cut parts of rays, given by ray and distance, at kinks; a piece has the depth
    of its part.
    """
    ray, x = kinks
    # The part in which each kink lies is the last one that begins before it.
    everything = np.lexsort((np.concatenate([parts.x0, x]), np.concatenate([parts.ray, ray])))
    begins = everything < len(parts.ray)
    part = np.cumsum(begins)[~begins] - 1
    kink = everything[~begins] - len(parts.ray)
    inside = (
        (part >= 0)
        & (parts.ray[part] == ray[kink])
        & (parts.x0[part] < x[kink])
        & (x[kink] < parts.x1[part])
    )
    part, x = part[inside], x[kink[inside]]
    # A part without kinks is one piece; each kink begins a further piece, which ends where the next
    # piece of the same part begins, or with the part.
    owner = np.concatenate([np.arange(len(parts.ray)), part])
    start = np.concatenate([parts.x0, x])
    order = np.lexsort((start, owner))
    owner, start = owner[order], start[order]
    ends = np.append(owner[1:] != owner[:-1], True)[: len(owner)]
    end = np.where(ends, parts.x1[owner], np.append(start[1:], 0.0)[: len(owner)])
    # Only the outer ends of a part can be edges between light and shadow.
    begin = np.append(True, ends[:-1])[: len(owner)]
    first, last = parts.first[owner] & begin, parts.last[owner] & ends
    pieces = Pieces(
        parts.ray[owner], parts.medium[owner], start, end, first, last, parts.depth[owner], owner
    )
    # Two kinks at one place leave a piece without length.
    return pieces[end > start]
