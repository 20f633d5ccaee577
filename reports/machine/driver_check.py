# SPDX-License-Identifier: BSD-3-Clause
"""A driver of OpenGL is judged before its images are: the exported kernel `exact` over the certified integrals.

A driver whose every operation is as wrong as Vulkan permits was simulated in float64 with a prototype: 1.8e-5.
One beyond `LARGEST` computes other fog than its shader says.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from realtime.export.text import kernel_text
from realtime.methods.shader.client import ShaderHost
from realtime.scene.phase import named_phase
from validation.certified.files import certified_data
from validation.kernels.case_files import read_cases

#: The largest relative error of a driver that conforms.
LARGEST = 3e-5

_MAIN = """
uniform sampler2D rows;
out vec4 result;

void main() {
    vec4 ray = texelFetch(rows, ivec2(gl_FragCoord.x, 0), 0), medium = texelFetch(rows, ivec2(gl_FragCoord.x, 1), 0);
    result = vec4(al_integral(ray.x, ray.y, ray.z, ray.w, medium.x, medium.y));
}
"""


def exported_values(host: ShaderHost, text: str, columns: Sequence[Any]) -> NDArray[np.float64]:
    """Return J [1/m] of rays by an exported GLSL text on a driver; not a number where it does not compile.

    `columns`: foot, height, x0, x1 [m], sigma_t [1/m] and g, of shape (n,), n at most 16384.
    """
    stacked = np.stack([np.broadcast_to(column, np.shape(columns[0])) for column in columns], axis=1)
    given = np.zeros((2, len(stacked), 4), dtype=np.float32)
    given[0], given[1, :, :2] = np.minimum(stacked[:, :4], 3e38), stacked[:, 4:]
    whole = f"#version 430 core\n{text}{_MAIN}"
    stage = {"name": "rows", "text": whole, "kind": "picture", "size": [len(stacked), 1], "format": "rgba32f"}
    said, _ = host.ask("open", stages=[stage])
    if "log" in said:
        return np.full(len(stacked), math.nan)
    _, image = host.ask("frame", {"texture rows": given}, reset=True, frames=1, uniforms={})
    return np.asarray(image[0, :, 0], dtype=np.float64)


def driver_error(host: ShaderHost, kernel: str = "exact", phase: str = "hg") -> tuple[float, int]:
    """Return the largest relative error on the certified integrals, infinite where one is not finite, and their number.

    `host` must be a new one. `phase` is in words, see `realtime.scene.phase.named_phase`.
    """
    cases = read_cases(certified_data(f"airlight_integral{'_droplets' if phase.startswith('hg-draine') else ''}.csv"))
    assert cases.value is not None
    # With g = 0 Henyey and Greenstein's function is the isotropic one.
    own = np.isin(cases.phase, ("isotropic", "hg") if phase == "hg" else (phase,))
    columns = [getattr(cases, name)[own] for name in ("foot", "height", "x0", "x1", "sigma_t", "g")]
    values = exported_values(host, kernel_text(kernel, named_phase(phase), "glsl"), columns)
    error = np.abs(values / cases.value[own] - 1)
    return float(error.max()) if np.isfinite(error).all() else math.inf, int(own.sum())
