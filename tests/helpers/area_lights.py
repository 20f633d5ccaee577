# SPDX-License-Identifier: BSD-3-Clause
"""Scene dictionaries with lights that have extent."""

from typing import Any

BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0, 0.0, 0.0]}}
NULL = {"type": "null"}


def lamp(kind: str = "rectangle", *, radiance=(3.0, 2.0, 1.0), bsdf=None, **shape: Any) -> dict[str, Any]:
    """Return an area light of this kind; `bsdf` is black by default."""
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
    return {"type": kind, "emitter": emitter, "bsdf": BLACK if bsdf is None else bsdf, **shape}


def fog(sigma_t=0.21, albedo=0.83) -> dict[str, Any]:
    """Return an endless medium."""
    return {
        "type": "homogeneous",
        "sigma_t": {"type": "rgb", "value": [sigma_t] * 3},
        "albedo": {"type": "rgb", "value": [albedo] * 3},
    }


def lit_scene(*, size=(4, 3), to_world=None, medium=None, **shapes: Any):
    """Return a Mitsuba scene with a camera in fog, looking along z from the origin by default."""
    import mitsuba as mi

    medium = fog() if medium is None else medium
    sensor = {
        "type": "perspective",
        "fov": 60.0,
        "to_world": mi.ScalarTransform4f() if to_world is None else to_world,
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1]},
        "medium": medium,
    }
    return mi.load_dict({"type": "scene", "sensor": sensor, **shapes})
