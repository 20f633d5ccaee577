# SPDX-License-Identifier: BSD-3-Clause
"""A box and a sphere as Mitsuba's dictionaries, and their bounds."""

import mitsuba as mi

from reference.scene.convex_bounds import read_bounds


def box(centre=(0.0, 0.0, 0.0), half=(1.0, 1.0, 1.0)) -> dict:
    transform = mi.ScalarTransform4f().translate(list(centre)).scale(list(half))
    return {"type": "cube", "to_world": transform}


def sphere(centre=(0.0, 0.0, 0.0), radius=1.0) -> dict:
    return {"type": "sphere", "center": list(centre), "radius": radius}


def bounds_of(shape):
    return read_bounds(mi.load_dict(shape))
