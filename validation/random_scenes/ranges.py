# SPDX-License-Identifier: BSD-3-Clause
"""What is drawn, from where to where. The defaults cover the methods' whole field; a TOML table overrides them.

    meshes = "folder"                  # of .obj and .ply files, which take part as casters
    optical_depth = [0.01, 3.0]
    lights = [1, 2]
    light_kinds = { point = 1, sphere = 2 }

A pair is a range, a table of numbers are the weights of a choice: what has weight 0 or is not named never comes.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from analytic.errors import InputError, nearest

Range = tuple[float, float]
Weights = Mapping[str, float]


def _limits(least: float, most: float, says: str) -> dict[str, Any]:
    return {"limits": (least, most), "says": says}


@dataclass(frozen=True)
class Ranges:
    """Ranges of all that is drawn. Lengths are in radii of the stage, the ball that the camera looks at."""

    scale: Range = field(
        default=(0.13, 71.0), metadata=_limits(1e-3, 1e4, "radius of the stage [m], evenly in the logarithm")
    )
    optical_depth: Range = field(
        default=(1e-3, 20.0), metadata=_limits(1e-6, 50.0, "of a medium, evenly in the logarithm")
    )
    colour_spread: Range = field(
        default=(0.03, 0.7), metadata=_limits(0.0, 0.9, "how far three extinctions lie apart, relative")
    )
    albedo: Range = field(default=(0.23, 0.99), metadata=_limits(0.0, 1.0, "single-scattering albedo"))
    g: Range = field(
        default=(-0.43, 0.93), metadata=_limits(-0.99, 0.99, "mean cosine of Henyey and Greenstein's function")
    )
    droplets: Range = field(
        default=(5.3, 47.0), metadata=_limits(5.0, 50.0, "diameter of the droplets of hg-draine [um]")
    )
    bounded_media: Range = field(default=(1, 3), metadata=_limits(1, 5, "how many bounded media, where there are any"))
    bounds: Range = field(default=(0.43, 1.9), metadata=_limits(0.1, 4.0, "size of a bounded medium"))
    lights: Range = field(default=(1, 8), metadata=_limits(1, 16, "how many lights; half of the scenes have one"))
    light_distance: Range = field(
        default=(0.31, 5.3), metadata=_limits(0.1, 100.0, "of a light from the middle, evenly in the logarithm")
    )
    light_size: Range = field(
        default=(0.013, 0.61), metadata=_limits(1e-4, 2.0, "radius or half side of a light with extent")
    )
    brightness: Range = field(
        default=(0.07, 3.1),
        metadata=_limits(1e-6, 1e6, "airlight of a light in the middle of the image, without shadows"),
    )
    cutoff: Range = field(default=(7.3, 73.0), metadata=_limits(0.5, 89.0, "half angle of a spot's cone [degrees]"))
    casters: Range = field(default=(1, 24), metadata=_limits(0, 200, "how many casters, evenly in the logarithm"))
    caster_size: Range = field(
        default=(0.07, 0.57), metadata=_limits(1e-3, 3.0, "radius of the ball around a caster, evenly in the logarithm")
    )
    camera_distance: Range = field(default=(1.3, 4.7), metadata=_limits(0.5, 50.0, "of the camera from the middle"))
    camera_elevation: Range = field(
        default=(-17.0, 53.0), metadata=_limits(-85.0, 85.0, "of the camera above the middle [degrees]")
    )
    fov: Range = field(default=(23.0, 83.0), metadata=_limits(1.0, 160.0, "horizontal field of view [degrees]"))
    media: Weights = field(
        default_factory=lambda: {"endless": 4, "bounded": 4, "both": 1.5}, metadata={"says": "where media are"}
    )
    extinctions: Weights = field(
        default_factory=lambda: {"one": 3, "three": 2}, metadata={"says": "one extinction or three"}
    )
    phases: Weights = field(
        default_factory=lambda: {
            "isotropic": 3,
            "hg": 5,
            "rayleigh": 2,
            "hazy": 0.8,
            "murky": 0.8,
            "hg-draine": 0.7,
            "mie": 0,
        },
        metadata={"says": "phase functions; the table of mie takes 13 s"},
    )
    bounds_kinds: Weights = field(
        default_factory=lambda: {"sphere": 1, "box": 2, "gem": 1, "ellipsoid": 1}, metadata={"says": "bounds of media"}
    )
    light_kinds: Weights = field(
        default_factory=lambda: {"point": 4, "spot": 3, "directional": 3, "rectangle": 1, "disk": 1, "sphere": 1},
        metadata={"says": "kinds of lights"},
    )
    light_materials: Weights = field(
        default_factory=lambda: {"black": 3, "null": 2}, metadata={"says": "of lights with extent"}
    )
    caster_kinds: Weights = field(
        default_factory=lambda: {
            "box": 3,
            "tetrahedron": 1,
            "icosphere": 3,
            "gem": 1,
            "torus": 2,
            "star": 1,
            "vase": 1,
            "plate": 4,
            "sheet": 1,
            "fence": 3,
            "pierced": 2,
            "mesh": 4,
        },
        metadata={"says": "kinds of casters"},
    )
    grounds: Weights = field(
        default_factory=lambda: {"none": 2, "floor": 5, "floor-and-wall": 3, "room": 2},
        metadata={"says": "what lies under and behind"},
    )
    camera_in: Weights = field(
        default_factory=lambda: {"light": 3, "shadow": 1}, metadata={"says": "first light on the camera"}
    )
    camera_inside: Weights = field(
        default_factory=lambda: {"no": 3, "yes": 2}, metadata={"says": "camera beside bounded media, or in one"}
    )
    cages: Weights = field(default_factory=lambda: {"no": 8, "yes": 1}, metadata={"says": "bars around a light"})
    spheres: Weights = field(
        default_factory=lambda: {"no": 14, "yes": 1},
        metadata={"says": "a ball that is no mesh, which methods of silhouettes refuse"},
    )
    meshes: str = field(default="", metadata={"says": "folder of .obj and .ply files"})


def read_ranges(path: Path) -> Ranges:
    """Read ranges from a TOML file.

    Raises
    ------
    InputError
        For a missing or malformed file, and as `ranges_from`.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"ranges: cannot read {path}: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"ranges: {path} is no TOML: {error}") from error
    return ranges_from(table, str(path))


def ranges_from(table: Mapping[str, Any], where: str = "ranges") -> Ranges:
    """Return ranges with what a table says in place of the defaults.

    Parameters
    ----------
    table
        Ranges as pairs and weights as tables, by the names of `Ranges`.

    Raises
    ------
    InputError
        For an unknown name, a range that is empty or beyond what can be drawn, and weights of which none is above 0.
    """
    known = {each.name: each for each in fields(Ranges)}
    changed: dict[str, Any] = {}
    for name, value in table.items():
        if name not in known:
            raise InputError(f"{where}: got {name!r}, wanted some of {', '.join(known)}{nearest(name, known)}")
        metadata = known[name].metadata
        if "limits" in metadata:
            changed[name] = _checked_range(f"{where}: {name}", value, metadata["limits"])
        elif name != "meshes":
            changed[name] = _checked_weights(f"{where}: {name}", value, getattr(Ranges(), name))
        else:
            if not isinstance(value, str) or (value and not Path(value).is_dir()):
                raise InputError(f"{where}: {name} is {value!r}; wanted a folder of .obj and .ply files")
            changed[name] = value
    return replace(Ranges(), **changed)


def _checked_range(where: str, value: Any, limits: Range) -> Range:
    least, most = limits
    pair = value if isinstance(value, list | tuple) else [value, value]
    sound = len(pair) == 2 and all(
        isinstance(each, int | float) and not isinstance(each, bool) and math.isfinite(each) for each in pair
    )
    if not sound or not least <= pair[0] <= pair[1] <= most:
        raise InputError(f"{where} is {value!r}; wanted [from, to], two numbers from {least:g} to {most:g}")
    return float(pair[0]), float(pair[1])


def _checked_weights(where: str, value: Any, usual: Weights) -> Weights:
    names = tuple(usual)
    if not isinstance(value, Mapping):
        raise InputError(f"{where} is {value!r}; wanted a table of weights, such as {{ {names[0]} = 1 }}")
    for name, weight in value.items():
        if name not in names:
            raise InputError(f"{where}: got {name!r}, wanted some of {', '.join(names)}{nearest(name, names)}")
        if isinstance(weight, bool) or not isinstance(weight, int | float) or not 0 <= weight < math.inf:
            raise InputError(f"{where}: {name} has the weight {weight!r}; wanted a number of 0 or more")
    if not any(value.values()):
        raise InputError(f"{where}: no weight is above 0; wanted one at least")
    return {name: float(value.get(name, 0.0)) for name in names}
