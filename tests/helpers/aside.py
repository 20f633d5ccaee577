# SPDX-License-Identifier: BSD-3-Clause
"""Scenes of fog kept aside: the diagnosis was not developed on them.

`python -m tests.helpers.aside FOLDER` writes them as XML files for `airlight bench FOLDER/*.xml --diagnosis`. Two lamps
in coloured fog; a spot into a bounded medium, from outside; a sun on two media; a spot and a lamp in dense fog that
scatters back.
"""

import sys
from pathlib import Path

_HEAD = """<scene version="3.0.0"><integrator type="volpath"/>
<sensor type="perspective"><float name="fov" value="{fov}"/><string name="fov_axis" value="x"/>
<float name="near_clip" value="1e-4"/><transform name="to_world"><lookat origin="{origin}" target="{target}"
up="0, 0, 1"/></transform>{around}<film type="hdrfilm"><integer name="width" value="160"/>
<integer name="height" value="120"/><rfilter type="box"/></film></sensor>"""
_FOG = """<medium type="homogeneous" id="{id}"><{kind} name="sigma_t" value="{sigma_t}"/>
<rgb name="albedo" value="{albedo}"/><phase type="hg"><float name="g" value="{g}"/></phase></medium>"""
_LAMP = """<emitter type="point" id="{id}"><point name="position" value="{place}"/>
<rgb name="intensity" value="{intensity}"/></emitter>"""
_SPOT = """<emitter type="spot" id="{id}"><transform name="to_world"><lookat origin="{place}" target="{target}"
up="0, 1, 0"/></transform><float name="cutoff_angle" value="{cutoff}"/><float name="beam_width" value="{beam}"/>
<rgb name="intensity" value="{intensity}"/></emitter>"""
_SHINE = """<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>"""
_BALL = """<shape type="sphere"><point name="center" value="{place}"/><float name="radius" value="{radius}"/>{inside}
</shape>"""
_PLATE = """<shape type="{shape}"><transform name="to_world"><scale x="{x}" y="{y}" z="{z}"/>
<rotate z="1" angle="{turn}"/><translate value="{place}"/></transform>{inside}</shape>"""
_AROUND = '<ref name="medium" id="fog"/>'


def _hollow(medium: str) -> str:
    return f'<bsdf type="null"/><ref name="interior" id="{medium}"/>'


SCENES = {
    "two-lamps": (
        _FOG.format(id="fog", kind="rgb", sigma_t="0.113, 0.171, 0.247", albedo="0.91, 0.83, 0.72", g=0.37)
        + _HEAD.format(fov=53.1, origin="0.37, -5.9, 1.43", target="0.21, 0.3, 1.17", around=_AROUND)
        + _LAMP.format(id="left", place="-1.31, 0.83, 2.17", intensity="7.3, 6.1, 4.7")
        + _LAMP.format(id="right", place="1.83, -0.71, 1.37", intensity="2.9, 3.7, 5.3")
        + _BALL.format(place="0.13, -0.37, 1.09", radius=0.43, inside=_SHINE.format("0.61, 0.47, 0.39"))
        + _PLATE.format(
            shape="rectangle", x=7.3, y=6.1, z=1, turn=0, place="0, 0, -0.13", inside=_SHINE.format("0.37, 0.41, 0.43")
        )
    ),
    "spot-in-box": (
        _FOG.format(id="haze", kind="float", sigma_t=0.293, albedo="0.87, 0.87, 0.81", g=-0.23)
        + _HEAD.format(fov=41.7, origin="-0.41, -7.3, 1.97", target="0.17, 0.1, 0.87", around="")
        + _SPOT.format(
            id="spot",
            place="1.13, -0.47, 2.89",
            target="-0.23, 0.31, 0.1",
            cutoff=29.3,
            beam=17.9,
            intensity="31, 27, 19",
        )
        + _PLATE.format(
            shape="cube", x=2.17, y=1.83, z=1.41, turn=17.3, place="0.07, 0.13, 1.43", inside=_hollow("haze")
        )
        + _BALL.format(place="0.31, 0.09, 1.03", radius=0.29, inside=_SHINE.format("0.53, 0.57, 0.31"))
    ),
    "sun-on-two": (
        _FOG.format(id="ground", kind="float", sigma_t=0.217, albedo="0.79, 0.83, 0.89", g=0.53)
        + _FOG.format(id="ball", kind="rgb", sigma_t="0.61, 0.47, 0.53", albedo="0.93, 0.89, 0.77", g=-0.31)
        + _HEAD.format(fov=46.9, origin="0.83, -6.7, 2.31", target="0.11, 0.2, 1.07", around="")
        + '<emitter type="directional" id="sun"><vector name="direction" value="0.43, 0.59, -0.83"/>'
        '<rgb name="irradiance" value="2.9, 2.3, 1.7"/></emitter>'
        + _PLATE.format(
            shape="cube", x=2.71, y=1.93, z=0.71, turn=-11.9, place="0.1, 0.2, 0.73", inside=_hollow("ground")
        )
        + _BALL.format(place="-0.47, 0.13, 2.21", radius=0.73, inside=_hollow("ball"))
        + _PLATE.format(
            shape="cube",
            x=0.31,
            y=0.23,
            z=0.53,
            turn=31.7,
            place="0.79, -0.41, 0.97",
            inside=_SHINE.format("0.43, 0.37, 0.29"),
        )
    ),
    "spot-and-lamp": (
        _FOG.format(id="fog", kind="float", sigma_t=0.437, albedo="0.71, 0.77, 0.83", g=-0.41)
        + _HEAD.format(fov=61.3, origin="-0.29, -3.7, 1.13", target="0.19, 0.4, 0.71", around=_AROUND)
        + _SPOT.format(
            id="spot",
            place="-1.07, -0.61, 2.23",
            target="0.37, 0.43, 0.2",
            cutoff=23.7,
            beam=23.7,
            intensity="17, 19, 23",
        )
        + _LAMP.format(id="lamp", place="1.17, 0.59, 0.97", intensity="1.3, 1.1, 0.7")
        + _PLATE.format(
            shape="cube",
            x=0.37,
            y=0.29,
            z=0.41,
            turn=23.9,
            place="0.29, 0.17, 0.53",
            inside=_SHINE.format("0.47, 0.53, 0.59"),
        )
    ),
}


def write_scenes(folder: Path) -> list[Path]:
    """Write the scenes into a folder as XML files."""
    paths = []
    for name, text in SCENES.items():
        path = folder / f"{name}.xml"
        path.write_text(_in_order(text))
        paths.append(path)
    return paths


def _in_order(text: str) -> str:
    """Return a scene whose media, which others refer to, stand inside it."""
    start = text.index("<scene")
    end = text.index(">", start) + 1
    return f"{text[start:end]}{text[:start]}{text[end:]}</scene>\n"


if __name__ == "__main__":
    print("\n".join(map(str, write_scenes(Path(sys.argv[1])))))
