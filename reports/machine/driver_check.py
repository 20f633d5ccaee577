# SPDX-License-Identifier: BSD-3-Clause
"""A driver of OpenGL is judged before its images are: the exported kernel `exact` over
the certified integrals.

A driver beyond `realtime.export.text.CONFORMING` computes other fog than its shader says.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.realtime.export.text import kernel_text
from airlight.realtime.methods.shader.client import ShaderHost
from airlight.realtime.scene.phase import named_phase
from airlight.reference.storage.store import Inputs, stored
from airlight.validation.certified.files import certified_data
from airlight.validation.kernels.case_files import read_cases

_MAIN = """
uniform sampler2D rows;
out vec4 result;

void main() {
    vec4 ray = texelFetch(rows, ivec2(gl_FragCoord.x, 0), 0), medium = texelFetch(rows, ivec2(gl_FragCoord.x, 1), 0);
    result = vec4(al_integral(ray.x, ray.y, ray.z, ray.w, medium.x, medium.y));
}
"""


def exported_values(host: ShaderHost, text: str, columns: Sequence[Any]) -> NDArray[np.float64]:
    """Return J [1/m] of rays by an exported GLSL text on a driver; not a number
    where it does not compile.

    `columns`: foot, height, x0, x1 [m], sigma_t [1/m] and g, of shape (n,), n at most 16384.
    """
    stacked = np.stack(
        [np.broadcast_to(column, np.shape(columns[0])) for column in columns], axis=1
    )
    given = np.zeros((2, len(stacked), 4), dtype=np.float32)
    # A ray is two texels: foot, height, x0, x1, then sigma_t and g. Infinity becomes a large
    # number, as a texture need not hold it.
    given[0], given[1, :, :2] = np.minimum(stacked[:, :4], 3e38), stacked[:, 4:]
    whole = f"#version 430 core\n{text}{_MAIN}"
    # One pixel a ray.
    stage = {
        "name": "rows",
        "text": whole,
        "kind": "picture",
        "size": [len(stacked), 1],
        "format": "rgba32f",
    }
    said, _ = host.ask("open", stages=[stage])
    if "log" in said:
        return np.full(len(stacked), math.nan)
    _, image = host.ask("frame", {"texture rows": given}, reset=True, frames=1, uniforms={})
    return np.asarray(image[0, :, 0], dtype=np.float64)


@dataclass(frozen=True)
class DriverInputs(Inputs):
    """The inputs of the error of a driver."""

    kind = "shader-driver"
    device: str  #: name and version


def error_of_device(device: str, *, host: ShaderHost) -> float:
    """Return the `driver_error` of the device of a host, by its name and version."""
    return stored(DriverInputs(device), lambda: driver_error(host)[0], float).value


def driver_error(host: ShaderHost, kernel: str = "exact", phase: str = "hg") -> tuple[float, int]:
    """Return the largest relative error on the certified integrals, infinite where one is not
    finite, and their number.

    `host` must be a new one. `phase` is in words, see `realtime.scene.phase.named_phase`.
    """
    columns, expected = certified_rays(phase)
    error = np.abs(
        exported_values(host, kernel_text(kernel, named_phase(phase), "glsl"), columns) / expected
        - 1
    )
    return float(error.max()) if np.isfinite(error).all() else math.inf, len(expected)


def certified_rays(phase: str) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the columns that `exported_values` takes of the certified rays of a phase
    function, and their J [1/m].
    """
    cases = read_cases(
        certified_data(
            f"airlight_integral{'_droplets' if phase.startswith('hg-draine') else ''}.csv"
        )
    )
    assert cases.value is not None
    # With g = 0 Henyey and Greenstein's function is the isotropic one.
    selected = np.isin(cases.phase, ("isotropic", "hg") if phase == "hg" else (phase,))
    columns = [
        getattr(cases, name)[selected] for name in ("foot", "height", "x0", "x1", "sigma_t", "g")
    ]
    return columns, cases.value[selected]
