# SPDX-License-Identifier: BSD-3-Clause
"""What a report says besides its scenes, by hand: papers' tables, stability of kernels, faults of the physics."""

from tests.helpers.reports import timing

BIRI = {
    "stages": ["silhouettes", "scene", "airlight of the scene", "sorting", "shadow planes"],
    "rows": [
        {
            "published": {
                "scene": "clutter",
                "where": "Fig. 7c",
                "size": [800, 600],
                "fps": 38,
                "shares": [1.7, 14, 33.6, 16, 34.7],
                "note": note,
                "cone": 0,
            },
            "kernel": kernel,
            "cone": 0,
            "size": size,
            "triangles": 20747,
            "stages_ms": [1.0, 2.0, 3.0, 4.0, 10.0],
            "shares": [5.0, 10.0, 15.0, 20.0, 50.0],
            "light_moved": timing(20.0),
            "static": timing(12.5),
            "light_moved_camera_kept": timing(16.0),
            "colours_changed": timing(10.0),
            "rays": timing(4.0),
            "error": {"relative_rmse": 0.002, "relative_bias": 0.001, "p99": 0.01},
            "error_size": [160, 120],
        }
        for kernel, size, note in (("exact", [800, 600], "a note"), ("taylor", [80, 60], ""))
    ],
}

_ENTRY = {"where": "Fig. 6a", "scene": "omni-box", "map": 32, "method": "light-volumes", "fps": 230}
_ERROR = {"relative_rmse": 0.002, "p99": 0.01}
_TIMES = {
    "light_moved": timing(2.0),
    "static": timing(1.0),
    "light_moved_camera_kept": timing(1.6),
    "colours_changed": timing(0.8),
}
_IMAGE = {"entry": _ENTRY | {"parameters": [["evaluation", "walk"]]}, "size": [1024, 1024], "missing": None}
_VIEW = {"map": 1024, "evaluation": "static", "size": [1024, 1024], "faces": 1, "scene": "colonnade"}
_PUBLISHED = {"what": "Sponza", "fps": 86, "passes": {"volume": 9.0}}
_BLANK = {
    "light_moved": None,
    "static": None,
    "light_moved_camera_kept": None,
    "colours_changed": None,
    "error": None,
}

BILLETER = {
    "figures": [_IMAGE | _TIMES | {"error": _ERROR}, _IMAGE | _BLANK | {"missing": "too slow"}],
    "table": [
        _VIEW
        | _TIMES
        | {"triangles": 7, "passes": {"volume": 12.5}, "against_static": _ERROR, "published": _PUBLISHED},
        _VIEW | _BLANK | {"missing": "too big", "triangles": 0, "passes": {}, "published": _PUBLISHED},
    ],
}


_ERRORS = {"rays": 77, "refused": 5, "median": 1.5e-7, "p99": 2.5e-6, "max": 4.5e-6}
_ERRORS |= {"nan": 0, "infinite": 0, "negative": 2}
STABILITY = [
    {
        "kernel": "my-kernel",
        "broken": ["law of scale"],
        "sets": [{"name": "certified", "single": {"all": _ERRORS}, "double": {"all": _ERRORS}}],
    }
]
