# SPDX-License-Identifier: BSD-3-Clause
"""Height fog as a grid of densities, for renderers that do not know its layers.

A grid is linear between the middles of its voxels, and constant beyond the outermost. Linear
interpolation of an exponential is too dense by (u/2)/tanh(u/2), u = dz/H, in every cell alike:
nodes times tanh(u/2)/(u/2) have the optical depth of the layer between any two of them, but for
the cell in which a clamped layer begins. With dz = H/20 densities differ by 2e-4 at the nodes.
"""

from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.phase import HenyeyGreenstein, PhaseFunction, Tabulated
from airlight.errors import InputError
from airlight.reference.scene.varying import GridMedium, HeightMedium
from airlight.reference.storage.files import write_bytes

Array = NDArray[np.float64]


def fog_grid(medium: HeightMedium) -> Array:
    """Return the densities of voxels from the floor to the cap, (N,) [1/m], at most a million."""
    # The thinnest layer decides the step, a twentieth of its scale height (see the module); without
    # layers the density is constant, and two voxels hold it.
    least = min((scale for _, _, scale in medium.layers), default=medium.cap - medium.floor)
    count = max(2, int(np.ceil(20 * (medium.cap - medium.floor) / least)))
    most = 1 << 20
    if count > most:
        raise InputError(
            f"the height fog takes {count} voxels, 20 a scale height; expected at most {most}: "
            "lower its cap"
        )
    step = (medium.cap - medium.floor) / count
    z = medium.floor + step * (np.arange(count) + 0.5)
    # The middles of voxels are the nodes between which a renderer interpolates. The factor
    # tanh(u/2)/(u/2) keeps the optical depth between any two of them (see the module).
    total = np.full(count, medium.constant)
    for sigma_t, base, scale in medium.layers:
        half = 0.5 * step / scale
        fall = np.exp(-(z - base) / scale) * np.tanh(half) / half
        total += sigma_t * (np.where(z < base, 1.0, fall) if medium.clamped else fall)
    return total


def write_fog_grid(path: Path, medium: HeightMedium | GridMedium) -> str:
    """Write height fog or a grid as a volume file of Mitsuba, whole or not at all, and
    return the medium that reads it, as XML.
    """
    import mitsuba as mi

    # A grid is written as it is; height fog becomes a column of voxels.
    if isinstance(medium, GridMedium):
        values, corner, size = medium.values, medium.low, medium.high - medium.low
    else:
        values, corner, size = _whole_grid(medium)
    stream = mi.MemoryStream()
    mi.VolumeGrid(values[..., None].astype(np.float32)).write(stream)
    write_bytes(path, stream.raw_buffer())
    words = [", ".join(f"{value:.9g}" for value in each) for each in (size, corner, medium.albedo)]
    parts = (
        f'<volume type="gridvolume" name="sigma_t"> <string name="filename" value="{escape(str(path))}"/>',
        '<boolean name="raw" value="true"/> <string name="wrap_mode" value="clamp"/>',
        f'<transform name="to_world"> <scale value="{words[0]}"/> <translate value="{words[1]}"/> '
        "</transform>",
        "</volume>",
        f'<rgb name="albedo" value="{words[2]}"/> <boolean name="has_spectral_extinction" '
        'value="false"/>',
        _phase(medium.phase),
    )
    return f'<medium type="heterogeneous"> {" ".join(parts)} </medium>'


def _whole_grid(medium: HeightMedium) -> tuple[Array, Array, Array]:
    """Return the densities of height fog, (z, y, x) [1/m], and corner and
    size of their box, (3,) [m].
    """
    import mitsuba as mi

    # The axis along which the fog falls, and whether it falls upwards along it.
    density, height = fog_grid(medium), medium.cap - medium.floor
    axis = int(np.argmax(np.abs(medium.up)))
    upwards = bool(medium.up[axis] > 0)
    # Mitsuba's volumes are (z, y, x): the axis counts from the end.
    shape = [1, 1, 1]
    shape[2 - axis] = len(density)
    # Across the axis nothing varies: one voxel is as wide as the box that Mitsuba has for the fog,
    # about the middle of the file's own. Beyond its box a grid of Mitsuba is vacuum.
    parts = mi.traverse(medium.plugin).hierarchy
    box = next(part for part in parts if "H_1" in mi.traverse(part)).bbox()
    corner, high = (np.array(end, dtype=np.float64).ravel() for end in (box.min, box.max))
    size = high - corner
    size[axis], corner[axis] = height, medium.floor if upwards else -medium.cap
    return (density if upwards else density[::-1]).reshape(shape), corner, size


def _phase(phase: PhaseFunction) -> str:
    if isinstance(phase, HenyeyGreenstein):
        return f'<phase type="hg"> <float name="g" value="{phase.g:.9g}"/> </phase>'
    if isinstance(phase, Tabulated):
        values = ", ".join(f"{value:.9g}" for value in phase.table)
        return f'<phase type="tabphase"> <string name="values" value="{values}"/> </phase>'
    return f'<phase type="{phase.name}"/>'
