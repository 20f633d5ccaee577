# SPDX-License-Identifier: BSD-3-Clause
"""The description of a scene, a block of rows for each thing to set."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from reports.tables.table import Column, Table, table

_LISTED = 12  # surfaces that have a row; the others are in the JSON

Cells = tuple[str, str, str]  # what it is, which part of it, and its value


def description_table(described: Mapping[str, Any]) -> Table:
    """Return what `reports.interchange.scene.describe_scene` found, a row for each number to set."""
    width, height = described["camera"]["size"]
    title = f"{described['scene']}, {width} x {height} pixels. {described['purpose']}"
    columns = (
        Column("what", "", words=True),
        Column("part", "", words=True),
        Column("value", "", words=True, long=True),
    )
    return table(title, columns, _rows(described))


def _rows(described: Mapping[str, Any]) -> Iterator[Cells]:
    yield "units", "", f"metres, 1/m, W/sr, W/(m^2 sr); right-handed axes, {described['up']} up"
    yield from _camera(described["camera"])
    around = "around the bounded media" if described["bounded_media"] else "everywhere"
    yield from _medium(around, described["medium"])
    for bounded in described["bounded_media"]:
        yield from _medium(f"in {bounded['name']}", bounded)
    for light in described["lights"]:
        yield from _light(light)
    yield from _surfaces(described["surfaces"])
    yield from _drawn(described.get("drawn", {}))
    yield "radiance", "", described["radiance"]
    file = described["file"]
    yield "file to write", "", f"{file['name']}: {file['format']}; {'; '.join(file['layers'].values())}"
    yield "in Blender", "", "--json has `properties`: all of this by the names of Blender's Python"


def _drawn(drawn: Mapping[str, Any]) -> Iterator[Cells]:
    """Yield what was drawn for a random scene, a row for each part."""
    if not drawn:
        return
    yield (
        "drawn",
        "seed",
        f"{drawn['seed']}, draws before this one that let too little light through: {drawn['attempt']}",
    )
    yield "", "stage", f"a ball of {drawn['scale']:.5g} m about {_vector(drawn['centre'])}"
    for part in (drawn["camera"] | {"name": "camera"}, *drawn["media"], *drawn["lights"], *drawn["casters"]):
        yield "", part["name"], ", ".join(f"{key} {_short(value)}" for key, value in part.items() if key != "name")
    yield "", "reach", ", ".join(f"{key.replace('_', ' ')} {_short(value)}" for key, value in drawn["reach"].items())


def _short(value: Any) -> str:
    if isinstance(value, tuple | list):
        return "(" + ", ".join(_short(each) for each in value) + ")"
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _camera(camera: Mapping[str, Any]) -> Iterator[Cells]:
    width, height = camera["size"]
    yield "camera", "position", _vector(camera["position"])
    for axis in ("forward", "right", "up"):
        yield "", axis, _vector(camera[axis])
    angles = f"{camera['fov_horizontal']:.7g} degrees horizontally, {camera['fov_vertical']:.7g} vertically"
    yield "", "field of view", angles
    yield "", "image", f"{width} x {height} pixels; {camera['projection']}"


def _medium(name: str, medium: Mapping[str, Any] | None) -> Iterator[Cells]:
    if medium is None:
        yield "medium", "", f"{name}: none, clear air"
        return
    yield "medium", "", name
    if "bounds" in medium:
        bounds = medium["bounds"]
        if "radius" in bounds:
            yield "", "bounds", f"a sphere about {_vector(bounds['centre'])}, radius {bounds['radius']:.7g}"
        else:
            yield "", "bounds", f"a convex mesh of {bounds['facets']} facets; -o writes it"
    if "layers" in medium:
        yield from _height_fog(medium)
    elif "voxels" in medium:
        size = " x ".join(map(str, medium["voxels"]))
        yield "", "extinction", f"sigma_t a grid of {size} voxels, linear between their centres"
        yield "", "box", f"from {_vector(medium['low'])} to {_vector(medium['high'])}, with nothing beyond"
        yield "", "values", f"{medium['mean']:.7g} 1/m on average, {medium['largest']:.7g} 1/m at most"
        yield "", "albedo", _colour(medium["albedo"])
    else:
        yield "", "extinction", f"sigma_t {_colour(medium['sigma_t'])} 1/m"
        yield "", "albedo", _colour(medium["albedo"])
        yield "", "scattering", f"sigma_s = albedo sigma_t = {_colour(medium['sigma_s'])} 1/m"
        yield "", "absorption", f"sigma_a = sigma_t - sigma_s = {_colour(medium['sigma_a'])} 1/m"
        yield "", "mean free path", f"{_colour(medium['mean_free_path'])} m"
    phase = medium["phase"]
    g = f", g = {phase['g']:.7g}" if "g" in phase else ""
    yield "", "phase function", f"{phase['name']}{g}: {phase['formula']}; its integral over the sphere is 1"


def _height_fog(medium: Mapping[str, Any]) -> Iterator[Cells]:
    """Yield height fog by its layers; the height is that along its axis up."""
    yield "", "height", f"along {medium['up']}, from {medium['floor']:.7g} m to {medium['cap']:.7g} m, without sides"
    below = ", constant below" if medium["clamped"] else ""
    for number, layer in enumerate(medium["layers"], 1):
        numbers = f"sigma_t {layer['sigma_t']:.7g} 1/m at {layer['base']:.7g} m{below}"
        yield "", f"layer {number}", f"{numbers}; falls to 1/e in {layer['scale_height']:.7g} m"
    yield "", "everywhere", f"sigma_t {medium['constant']:.7g} 1/m"
    for name, engine in medium["engines"].items():
        numbers = engine.get("parameters", {})
        line = ", ".join(f"{key} {value:.7g}" for key, value in numbers.items()) or f"cannot: {engine['cannot']}"
        yield "", f"as in {name}", line
        if numbers:
            yield "", "not physical", engine["not_physical"]
            yield "", "not checked", engine["not_checked"]
    yield "", "albedo", _colour(medium["albedo"])


def _light(light: Mapping[str, Any]) -> Iterator[Cells]:
    if light["kind"] == "area":
        yield from _area(light)
    elif light["kind"] == "directional":
        yield "light", "", f"directional, travels along {_vector(light['axis'])}"
        yield "", "irradiance", f"{_colour(light['irradiance'])} W/m^2 on a plane that faces it"
    else:
        yield "light", "", f"{light['kind']}, at {_vector(light['position'])}"
        on_axis = " on the axis" if "axis" in light else ""
        yield "", "intensity", f"{_colour(light['intensity'])} W/sr{on_axis}"
        whole = f"4 pi I = {_colour(light['power_all_round'])} W"
        if "axis" in light:
            yield "", "power", f"{_colour(light['power'])} W; {whole} where a spot counts as a lamp all round (Blender)"
            yield "", "axis", _vector(light["axis"])
            angles = f"beam {light['beam_angle']:.7g}, cut-off {light['cutoff_angle']:.7g} degrees from the axis"
            yield "", "half angles, degrees", angles
        else:
            yield "", "power", whole
    yield "", "falloff", light["falloff"]


def _area(light: Mapping[str, Any]) -> Iterator[Cells]:
    opaque = "black: it ends rays and shadows" if light["material"] == "black" else "null: rays pass through it"
    yield "light", light["name"], f"area, a {light['shape']} about {_vector(light['position'])}; {opaque}"
    if "axis" in light:
        yield "", "normal", f"{_vector(light['axis'])}, the side that emits"
    if "sides" in light:
        width, height = light["sides"]
        yield (
            "",
            "sides",
            f"{width:.7g} m along {_vector(light['across'])}, {height:.7g} m along {_vector(light['up'])}",
        )
    else:
        yield "", "radius", f"{light['radius']:.7g} m"
    yield "", "radiance", f"{_colour(light['radiance'])} W/(m^2 sr)"
    yield "", "power", f"pi radiance area = {_colour(light['power'])} W, area {light['area']:.7g} m^2"
    flux = f"{light['luminous_flux']:.7g} lm: 683 lm/W times the luminance of the power as linear sRGB"
    yield "", "luminous flux", flux


def _surfaces(surfaces: list[Mapping[str, Any]]) -> Iterator[Cells]:
    if not surfaces:
        yield "surfaces", "", "none"
        return
    triangles = sum(surface["triangles"] or 0 for surface in surfaces)
    yield "surfaces", "", f"{len(surfaces)}, {triangles} triangles; diffuse: radiance = reflectance / pi irradiance"
    for surface in surfaces[:_LISTED]:
        what = f"{surface['triangles']} triangles" if surface["triangles"] is not None else surface["kind"].lower()
        sides = "two-sided" if surface["two_sided"] else "black from behind"
        notes = ", textured: its mean" if surface["textured"] else ""
        notes += "" if surface["diffuse"] else ", not diffuse: its diffuse part"
        yield "", surface["name"], f"{what}, reflectance {_colour(surface['reflectance'])}{notes}, {sides}"
    left = len(surfaces) - _LISTED
    if left > 0:
        yield "", "", f"and {left} more: --json lists them"


def _vector(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.7g}' for value in values)})"


def _colour(values: Sequence[float | None]) -> str:
    """Return one number where the channels are equal, else three."""
    words = ["infinite" if value is None else f"{value:.7g}" for value in values]
    return words[0] if len(set(words)) == 1 else f"({', '.join(words)})"
