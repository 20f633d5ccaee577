# SPDX-License-Identifier: BSD-3-Clause
"""Scene files of every kind that users bring, 16 x 12 pixels, with few triangles."""

from collections.abc import Callable
from pathlib import Path

import mitsuba as mi
import numpy as np

WIDTH, HEIGHT = 16, 12

_FOG = """<medium type="homogeneous" id="fog"><rgb name="sigma_t" value="0.11, 0.12, 0.14"/>
    <rgb name="albedo" value="0.9, 0.85, 0.7"/><phase type="hg"><float name="g" value="0.35"/></phase></medium>"""
_HEIGHT_FOG = """<medium type="heterogeneous" id="fog"><volume type="heightfog" name="sigma_t">
    <float name="sigma_1" value="0.13"/><float name="z_1" value="0.3"/><float name="H_1" value="2.7"/>
    <transform name="to_world"><scale x="40" y="40" z="43"/><translate x="-20" y="-20" z="-0.5"/></transform></volume>
    <rgb name="albedo" value="0.9, 0.85, 0.7"/></medium>"""
_LAMP = """<emitter type="point" id="lamp"><point name="position" x="0.4" y="0.9" z="3.7"/>
    <rgb name="intensity" value="37, 31, 23"/></emitter>"""
_SPOT = """<emitter type="spot" id="spot"><transform name="to_world">
    <lookat origin="-0.9, 1.3, 5.2" target="-0.7, 0.2, 0" up="0, 1, 0"/></transform>
    <rgb name="intensity" value="61, 71, 97"/><float name="cutoff_angle" value="37"/></emitter>"""
_SUN = """<emitter type="directional" id="sun"><vector name="direction" x="0.5" y="0.3" z="-0.45"/>
    <rgb name="irradiance" value="3, 2.6, 2.1"/></emitter>"""
_SKY = '<emitter type="constant" id="sky"><rgb name="radiance" value="0.07, 0.11, 0.21"/></emitter>'
_GROUND = '<shape type="rectangle" id="ground"><transform name="to_world"><scale value="60"/></transform></shape>'
_POST = """<shape type="cube" id="post"><transform name="to_world">
    <scale x="0.3" y="0.3" z="1.1"/><translate x="0.6" y="0.4" z="1.1"/></transform></shape>"""
_PANEL = """<transform name="to_world"><scale x="0.5" y="{}"/>
    <lookat origin="0.3, 0.4, 4.1" target="0.1, 0.2, 0" up="0, 1, 0"/></transform>"""


def _scene(*parts: str, medium: str = _FOG, version: str = "3.0.0") -> str:
    """Return a scene whose camera stands in a medium, or in vacuum."""
    inside = '<ref name="medium" id="fog"/>' if medium else ""
    return f"""<scene version="{version}">{medium}
    <sensor type="perspective"><float name="fov" value="45"/>{inside}
        <transform name="to_world"><lookat origin="0.3, -7.1, 2.3" target="0.1, 0.2, 1.9" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="{WIDTH}"/><integer name="height" value="{HEIGHT}"/></film>
    </sensor>
    {"".join(parts)}</scene>"""


def _area_light(kind: str, place: str) -> str:
    return f"""<shape type="{kind}" id="panel">{place}<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="17, 15, 12"/></emitter></shape>"""


def _bounded(name: str, x: float, sigma_t: str) -> str:
    return f"""<shape type="cube" id="{name}"><transform name="to_world">
        <scale x="0.9" y="0.9" z="1.2"/><translate x="{x}" y="0.3" z="1.9"/></transform><bsdf type="null"/>
        <medium type="homogeneous" name="interior"><rgb name="sigma_t" value="{sigma_t}"/>
        <rgb name="albedo" value="0.9, 0.85, 0.7"/></medium></shape>"""


def _mesh_light(folder: Path) -> str:
    """Return a light of four triangles, a strip that is folded so that parts of it hide others."""
    corners = [
        "-0.4 0.2 4.1",
        "-0.4 0.7 4.1",
        "0.1 0.2 3.8",
        "0.1 0.7 3.8",
        "0.6 0.2 4.2",
        "0.6 0.7 4.2",
    ]
    faces = ["1 2 3", "3 2 4", "3 4 5", "5 4 6"]
    lines = [*(f"v {corner}" for corner in corners), *(f"f {face}" for face in faces)]
    (folder / "strip.obj").write_text("\n".join(lines) + "\n")
    return _area_light("obj", '<string name="filename" value="strip.obj"/>')


def _smoke(folder: Path) -> str:
    values = np.random.default_rng(3).random((3, 4, 5), dtype=np.float32)
    mi.VolumeGrid(values[..., None]).write(str(folder / "smoke.vol"))
    return """<medium type="heterogeneous" id="fog"><volume type="gridvolume" name="sigma_t">
        <string name="filename" value="smoke.vol"/><transform name="to_world">
        <scale value="5, 4, 3.5"/><translate value="-2.5, -2.0, 0.3"/></transform></volume>
        <rgb name="albedo" value="0.9, 0.85, 0.7"/><float name="scale" value="0.8"/></medium>"""


def _cloud() -> str:
    return f"""{_SUN}{_SKY}<shape type="cube" id="cloud"><transform name="to_world">
        <scale x="1.9" y="1.3" z="1.2"/><translate x="0.1" y="0.3" z="1.9"/></transform><bsdf type="null"/>
        <medium type="homogeneous" name="interior"><float name="sigma_t" value="1.1"/><float name="albedo" value="1"/>
        <phase type="hg"><float name="g" value="0.85"/></phase></medium></shape>"""


def _lights() -> str:
    places = np.random.default_rng(5).uniform([-3, -1, 0.5], [3, 5, 4], size=(32, 3))
    return "".join(
        f"""<emitter type="point"><point name="position" x="{x:.3f}" y="{y:.3f}" z="{z:.3f}"/>
        <rgb name="intensity" value="{0.5 + number % 5}, 1, 1.5"/></emitter>"""
        for number, (x, y, z) in enumerate(places)
    )


def _older() -> str:
    """Return a scene of Mitsuba 0.5: camelCase, scattering and absorption, degrees of a spot."""
    medium = """<medium type="homogeneous" id="fog"><rgb name="sigmaS" value="0.1, 0.1, 0.1"/>
        <rgb name="sigmaA" value="0.01, 0.02, 0.04"/><phase type="hg"><float name="g" value="0.35"/></phase></medium>"""
    spot = _SPOT.replace("cutoff_angle", "cutoffAngle")
    whole = _scene(spot, _GROUND, _POST, medium=medium, version="0.5.0")
    return whole.replace("to_world", "toWorld").replace("<lookat", "<lookAt")


#: By name, what makes the scene file; the folder is where files that it reads belong.
KINDS: dict[str, Callable[[Path], str]] = {
    "no occluder": lambda folder: _scene(_LAMP),
    "occluders": lambda folder: _scene(_SPOT, _GROUND, _POST),
    "bounded media": lambda folder: _scene(
        _LAMP,
        _GROUND,
        _bounded("red", -1.3, "0.9, 0.3, 0.2"),
        _bounded("blue", 1.4, "0.2, 0.3, 0.8"),
        medium="",
    ),
    "rectangle": lambda folder: _scene(
        _GROUND, _POST, _area_light("rectangle", _PANEL.format(0.3))
    ),
    "disk": lambda folder: _scene(_GROUND, _POST, _area_light("disk", _PANEL.format(0.5))),
    "sphere": lambda folder: _scene(
        _GROUND,
        _POST,
        _area_light(
            "sphere",
            '<point name="center" x="0.3" y="0.4" z="4.1"/><float name="radius" value="0.4"/>',
        ),
    ),
    "mesh": lambda folder: _scene(_GROUND, _POST, _mesh_light(folder)),
    "32 lights": lambda folder: _scene(_GROUND, _POST, _lights()),
    "height fog, lamp": lambda folder: _scene(_LAMP, _GROUND, _POST, medium=_HEIGHT_FOG),
    "height fog, sun": lambda folder: _scene(_SUN, _GROUND, _POST, medium=_HEIGHT_FOG),
    "density grid": lambda folder: _scene(_LAMP, _GROUND, _POST, medium=_smoke(folder)),
    "sky": lambda folder: _scene(_LAMP, _SKY, _GROUND, _POST, medium=_HEIGHT_FOG),
    "cloud": lambda folder: _scene(_cloud(), medium=""),
    "Mitsuba 0.6": lambda folder: (
        _scene(_SPOT, _GROUND, _POST, version="0.6.0")
        .replace("sigma_t", "sigmaT")
        .replace("to_world", "toWorld")
        .replace("cutoff_angle", "cutoffAngle")
    ),
    "Mitsuba 0.5": lambda folder: _older(),
}


def write_kind(name: str, folder: Path) -> Path:
    """Write a scene of a kind, with the files that it reads, into a folder of
    its own; return its path.
    """
    own = folder / name.replace(", ", "-").replace(" ", "-")
    own.mkdir(parents=True, exist_ok=True)
    path = own / f"{own.name}.xml"
    path.write_text(KINDS[name](own), encoding="utf-8")
    return path
