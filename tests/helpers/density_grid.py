# SPDX-License-Identifier: BSD-3-Clause
"""A scene file with a density grid around the camera."""

from pathlib import Path

import mitsuba as mi
import numpy as np

LOW, HIGH = np.array([-2.5, -2.0, 0.3]), np.array([2.5, 2.0, 3.8])
ROUGH = np.random.default_rng(3).random((5, 6, 7)).astype(np.float32)
SCALE = 0.8
INSIDE = """<emitter type="point" id="lamp"><point name="position" x="0.4" y="0.3" z="2.2"/>
    <rgb name="intensity" value="37, 31, 23"/></emitter>"""
SPOT = """<emitter type="spot" id="spot">
    <transform name="to_world"><lookat origin="-3.1, 3.3, 6.2" target="-0.7, 0.2, 1.2" up="0, 1, 0"/></transform>
    <rgb name="intensity" value="61, 71, 97"/>
    <float name="cutoff_angle" value="27"/><float name="beam_width" value="17"/></emitter>"""
#: A ball in the grid and ground below.
SHAPES = """<shape type="rectangle" id="ground"><transform name="to_world"><scale value="20"/></transform></shape>
    <shape type="sphere" id="ball">
        <transform name="to_world"><scale value="0.7"/><translate x="-1.3" y="-0.4" z="2.1"/></transform></shape>"""
ALBEDO = '<rgb name="albedo" value="0.9, 0.85, 0.7"/>'


def volume(file: Path, values: np.ndarray, more: str = "", turn: str = "") -> str:
    """Write values as a file, and return the extinction of a medium that reads it."""
    mi.VolumeGrid(np.atleast_3d(values)[..., None] if values.ndim == 3 else values).write(str(file))
    size, corner = (", ".join(map(str, each)) for each in (HIGH - LOW, LOW))
    return f"""<volume type="gridvolume" name="sigma_t"><string name="filename" value="{file}"/>{more}
        <transform name="to_world"><scale value="{size}"/>{turn}<translate value="{corner}"/></transform></volume>"""


def grid_xml(
    extinction: str,
    *parts: str,
    size: tuple[int, int] = (16, 12),
    albedo: str = ALBEDO,
    shapes: str = SHAPES,
) -> str:
    """Return a scene file: a medium with an extinction around the camera, lights, and shapes."""
    width, height = size
    return f"""<scene version="3.0.0">
    <medium type="heterogeneous" id="smoke">{extinction}{albedo}
        <float name="scale" value="{SCALE}"/><phase type="hg"><float name="g" value="0.35"/></phase></medium>
    <sensor type="perspective"><float name="fov" value="40"/><ref id="smoke" name="medium"/>
        <transform name="to_world"><lookat origin="-8.7, -4.1, 2.3" target="0.3, 0.7, 1.9" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="{width}"/><integer name="height" value="{height}"/></film>
    </sensor>
    {shapes}{"".join(parts)}</scene>"""
