# SPDX-License-Identifier: BSD-3-Clause
"""The description of a scene as text, a block for each thing to set."""

import shlex
import textwrap
from collections.abc import Sequence
from typing import Any

_LISTED = 12  # surfaces that are printed one by one; the others are in the JSON
_WIDTH = 100


def description_text(found: dict[str, Any]) -> str:
    """Return what `reports.interchange.scene.describe_scene` found as text."""
    width, height = found["camera"]["size"]
    lines = [f"{found['scene']}, {width} x {height} pixels. {found['purpose']}", ""]
    lines += _row("units", f"metres, 1/m, W/sr, W/(m^2 sr); right-handed axes, {found['up']} up")
    lines += _camera(found["camera"])
    for name, medium in _media(found):
        lines += _medium(name, medium)
    for light in found["lights"]:
        lines += _light(light)
    lines += _surfaces(found["surfaces"])
    lines += _row("radiance", found["radiance"])
    file = found["file"]
    lines += _row("file to write", f"{file['name']}: {file['format']}; {'; '.join(file['layers'].values())}")
    command = shlex.join(["airlight", "compare", "--scene", found["source"], file["name"]])
    lines.append(f"{'to judge it':<17}{command}")  # never wrapped: it is there to be copied
    return "\n".join(lines)


def _camera(camera: dict[str, Any]) -> list[str]:
    width, height = camera["size"]
    lines = _row("camera", f"at {_vector(camera['position'])}")
    lines += [_item(axis, _vector(camera[axis])) for axis in ("forward", "right", "up")]
    lines.append(
        _item(
            "field of view",
            f"{camera['fov_horizontal']:.7g} degrees horizontally, {camera['fov_vertical']:.7g} vertically",
        )
    )
    lines.append(_item("image", f"{width} x {height} pixels"))
    return lines + _row("", camera["projection"])


def _media(found: dict[str, Any]) -> list[tuple[str, dict[str, Any] | None]]:
    around = "around all bodies" if found["bounded_media"] else "everywhere"
    return [(around, found["medium"]), *((f"in {one['name']}", one) for one in found["bounded_media"])]


def _medium(name: str, medium: dict[str, Any] | None) -> list[str]:
    if medium is None:
        return _row("medium", f"{name}: none, clear air")
    lines = _row("medium", name)
    if "bounds" in medium:
        bounds = medium["bounds"]
        ball = f"a ball about {_vector(bounds['centre'])}, radius {bounds['radius']:.7g}" if "radius" in bounds else ""
        lines.append(_item("bounds", ball or f"a convex mesh of {bounds['facets']} facets; --gltf writes it"))
    lines.append(_item("extinction", f"sigma_t {_colour(medium['sigma_t'])} 1/m"))
    lines.append(_item("albedo", _colour(medium["albedo"])))
    lines.append(_item("scattering", f"sigma_s = albedo sigma_t = {_colour(medium['sigma_s'])} 1/m"))
    lines.append(_item("absorption", f"sigma_a = sigma_t - sigma_s = {_colour(medium['sigma_a'])} 1/m"))
    lines.append(_item("mean free path", f"{_colour(medium['mean_free_path'])} m"))
    phase = medium["phase"]
    g = f", g = {phase['g']:.7g}" if "g" in phase else ""
    return lines + _row("", f"phase function {phase['name']}{g}: {phase['formula']}; its integral over the sphere is 1")


def _light(light: dict[str, Any]) -> list[str]:
    if light["kind"] == "directional":
        return [
            *_row("light", f"directional, travels along {_vector(light['axis'])}"),
            _item("irradiance", f"{_colour(light['irradiance'])} W/m^2 on a plane that faces it"),
            *_row("", light["falloff"]),
        ]
    lines = _row("light", f"{light['kind']}, at {_vector(light['position'])}")
    lines.append(
        _item("intensity", f"{_colour(light['intensity'])} W/sr" + (" on the axis" if "axis" in light else ""))
    )
    if "axis" in light:
        lines.append(_item("axis", _vector(light["axis"])))
        angles = f"beam {light['beam_angle']:.7g}, cut-off {light['cutoff_angle']:.7g} degrees from the axis"
        lines.append(_item("half angles", angles))
    return lines + _row("", light["falloff"])


def _surfaces(surfaces: list[dict[str, Any]]) -> list[str]:
    if not surfaces:
        return _row("surfaces", "none")
    triangles = sum(one["triangles"] or 0 for one in surfaces)
    lines = _row("surfaces", f"{len(surfaces)}, {triangles} triangles; diffuse: radiance = reflectance / pi irradiance")
    for one in surfaces[:_LISTED]:
        what = f"{one['triangles']} triangles" if one["triangles"] is not None else one["kind"].lower()
        sides = "two-sided" if one["two_sided"] else "black from behind"
        notes = ", textured: its mean" * one["textured"] + ", not diffuse: its diffuse part" * (not one["diffuse"])
        lines.append(_item(one["name"], f"{what}, reflectance {_colour(one['reflectance'])}{notes}, {sides}"))
    left = len(surfaces) - _LISTED
    return lines + ([_item("", f"and {left} more: --json lists them")] if left > 0 else [])


def _row(name: str, text: str) -> list[str]:
    """Return a text under its name, on as many lines as it needs."""
    first, rest = f"{name:<17}" if name else " " * 17, " " * 17
    return textwrap.wrap(text, _WIDTH, initial_indent=first, subsequent_indent=rest) or [first.rstrip()]


def _item(name: str, text: str) -> str:
    return f"  {name:<15}{text}" if len(name) < 15 else f"  {name} {text}"


def _vector(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.7g}' for value in values)})"


def _colour(values: Sequence[float | None]) -> str:
    """Return one number where the channels are equal, else three."""
    words = ["infinite" if value is None else f"{value:.7g}" for value in values]
    return words[0] if len(set(words)) == 1 else f"({', '.join(words)})"
