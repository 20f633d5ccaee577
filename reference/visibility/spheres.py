# SPDX-License-Identifier: BSD-3-Clause
"""What spheres take from the light of camera rays, in closed form.

In the plane of a ray and a light, as in `reference.visibility.triangles`, y is the component along n (from the light
to the foot point) and z that along the direction of the ray: the ray is y = h, and theta = atan2(z, y). The plane cuts
a sphere of centre C and radius R, at the signed distance c_s of the centre from the plane, in a disk of the centre
(c_y, c_z) and the radius

    rho = sqrt(R^2 - c_s^2).

**The light outside of the sphere.** What the disk hides is all that lies behind it, S = {t p : p in the disk, t >= 1}.
S is convex (a mean of t_1 p_1 and t_2 p_2 is a number >= 1 times a mean of p_1 and p_2), so it hides one interval of
the ray. The interval is what the part of the disk in the strip 0 < y <= h spans in theta. The disk as a whole spans

    phi -+ alpha,    phi = atan2(c_z, c_y),    alpha = atan2(rho, T),    T^2 = |C|^2 - R^2,

T being the length of the tangents from the light, which is the same in every plane, and the tangents end at
y = T cos(phi -+ alpha). For each of the two:

    T cos > h:         the strip leaves its tangent out; the span ends where the ray leaves the disk,
                       theta = atan2(c_z -+ sqrt(rho^2 - (h - c_y)^2), h);
    0 < T cos <= h:    the span ends at the tangent, theta = phi -+ alpha;
    T cos <= 0:        the disk reaches beyond the line y = 0 through the light: the span ends at -+ pi/2.

Nothing is hidden where the disk has no part in the strip: c_y - rho > h or c_y + rho <= 0. Since alpha < pi/2, phi -+
alpha lies within 3 pi/2 of zero: no angle is one of the other side in disguise.

**The light inside of the sphere.** It sees what is inside, and nothing else: hidden is all of the ray but its part in
the disk, which lies between the two angles of the first case, if it meets the disk at all.
"""

import numpy as np
from numpy.typing import NDArray

from reference.visibility.line_crossings import half_chord

Array = NDArray[np.float64]
Index = NDArray[np.int64]

Shadows = tuple[Index, Array, Array]


def sphere_shadows(spheres: tuple[Array, Array], direction: Array, normal: Array, height: Array) -> Shadows:
    """Return the intervals of the angle at the light that spheres hide.

    Parameters
    ----------
    spheres
        Their centres relative to the light, (spheres, 3), and radii, (spheres,) [m].
    direction, normal, height
        The rays: unit directions (n, 3), unit normals from the light to the foot points (n, 3), heights (n,) [m].

    Returns
    -------
    ray, low, high
        Numbers of the rays and angles in [-pi/2, pi/2] [rad], in no order.

    Notes
    -----
    Valid for spheres that are opaque surfaces: a light or camera inside sees what is inside. Where the plane touches a
    sphere within a share e of its radius, the width sqrt(8 e) R of the disk has lost digits: its relative error is
    1e-16 |C|/(R e), beyond `reference.visibility.triangles.EXACT_EDGE` for e below 1e-5, where the shadow is that of a
    sliver.
    """
    centre, radius = spheres
    side = np.cross(direction, normal) @ centre.T
    ray, sphere = np.nonzero(np.abs(side) < radius)
    disk = half_chord(radius[sphere], np.abs(side[ray, sphere]))
    c_y = np.einsum("ij,ij->i", normal[ray], centre[sphere])
    c_z = np.einsum("ij,ij->i", direction[ray], centre[sphere])
    distance = np.linalg.norm(centre, axis=1)
    inside = (distance < radius)[sphere]
    tangent = half_chord(distance, radius)[sphere]  # T^2 = |C|^2 - R^2: the same product, with both swapped

    outside = ~inside
    hidden = [hidden_behind(ray[outside], *(part[outside] for part in (c_y, c_z, disk, height[ray], tangent)))]
    if inside.any():
        hidden += hidden_from_inside(ray[inside], *(part[inside] for part in (c_y, c_z, disk, height[ray])))
    rows, low, high = (np.concatenate(parts) for parts in zip(*hidden, strict=True))
    return rows, low, high


def hidden_behind(ray: Index, c_y: Array, c_z: Array, disk: Array, height: Array, tangent: Array) -> Shadows:
    """Return what disks hide of rays from a light outside.

    Parameters
    ----------
    ray
        Number of the ray of each disk, (n,).
    c_y, c_z, disk
        Components of the centre and radius of the disk in the plane of the ray, (n,) each [m].
    height
        Of the rays, (n,) [m].
    tangent
        Length of the tangents from the light, (n,) [m].

    Returns
    -------
    ray, low, high
        As `sphere_shadows`.
    """
    middle, half = np.arctan2(c_z, c_y), np.arctan2(disk, tangent)
    chord = half_chord(disk, np.abs(height - c_y))
    ends = []
    for sign in (-1, 1):
        angle = middle + sign * half
        touched = tangent * np.cos(angle)
        cut = np.where(touched > height, np.arctan2(c_z + sign * chord, height), angle)
        ends.append(np.where(touched > 0, cut, sign * 0.5 * np.pi))
    dark = (c_y - disk <= height) & (c_y + disk > 0)
    return ray[dark], ends[0][dark], ends[1][dark]


def hidden_from_inside(ray: Index, c_y: Array, c_z: Array, disk: Array, height: Array) -> list[Shadows]:
    """Return what disks hide of rays from a light inside: all that lies before the disk and behind it.

    Parameters
    ----------
    ray, c_y, c_z, disk, height
        As in `hidden_behind`.

    Returns
    -------
    list
        Two results like that of `sphere_shadows`.
    """
    quarter = 0.5 * np.pi
    chord = half_chord(disk, np.abs(height - c_y))
    enters, leaves = np.arctan2(c_z - chord, height), np.arctan2(c_z + chord, height)
    return [(ray, np.full(len(ray), -quarter), enters), (ray, leaves, np.full(len(ray), quarter))]
