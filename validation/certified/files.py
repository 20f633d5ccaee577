# SPDX-License-Identifier: BSD-3-Clause
"""The files of certified values: what each holds, and where it is."""

from pathlib import Path

from airlight.errors import InputError, nearest

FOLDER = Path(__file__).parent

#: The files by name, with what they hold.
FILES = {
    "certified_fog.json": "twelve scenes of fog: the airlight of 64 camera rays each to 12 digits",
    "certified_area_lights.json": "points of area lights beside a ray, and spheres, to 15 digits",
    "airlight_integral.csv": (
        "the airlight integral to 20 digits, by foot and height of the light over the ray"
    ),
    "airlight_integral_rays.csv": "the airlight integral to 20 digits, by ray and light",
    "airlight_integral_droplets.csv": "the airlight integral in fog of droplets to 18 digits",
    "height_fog_rays.csv": (
        "airlight in exponential height fog to 20 digits, of point lights and suns"
    ),
    "model_rays.csv": (
        "lamps and suns by the equations of engines to 20 digits: distance laws, ranges, fractions "
        "of the depths on both ways"
    ),
    "airlight_slopes.csv": "derivatives of the airlight integral to 17 digits",
}


def certified_data(name: str = "certified_fog.json") -> Path:
    """Return the path of a file of certified values.

    Parameters
    ----------
    name
        Its name, such as `certified_integral.csv`; the scenes of fog by default.

    Raises
    ------
    InputError
        For a name that is no file of certified values: the message lists them.

    Examples
    --------
    >>> import json
    >>> import airlight
    >>> fog = json.loads(airlight.certified_data().read_text())
    >>> [scene["name"] for scene in fog["scenes"]][:2]
    ['thin-open', 'near-light']
    """
    if name not in FILES:
        raise InputError(
            f"certified data: got {name!r}, expected one of "
            f"{', '.join(FILES)}{nearest(name, FILES)}"
        )
    return FOLDER / name
