# SPDX-License-Identifier: BSD-3-Clause
"""A driver of OpenGL is judged before its images are: the kernel `exact` in GLSL over the certified airlight integrals.

The panels are those of `realtime.kernels.exact`, whose page derives them. `asinh` and `sinh` are our own: built-in ones
may be wrong by any factor near 0. The others are the driver's, as a user's shader would call them. A driver whose every
operation is as wrong as Vulkan permits was simulated in float64: 2.6e-5. One beyond that computes other fog than its
shader says. llvmpipe (LLVM 15.0.6) of Mesa 22.3.6: 3.5e-6 on 848 rows.
"""

import csv
import math
from typing import Any

import numpy as np

from realtime.kernels.exact import _DEPTH, _MOST, _NODES
from realtime.methods.shader.client import ShaderHost
from realtime.numerics.functions import unit_nodes
from realtime.scene.phase import HenyeyGreenstein
from validation.certified.files import certified_data

#: The largest relative error of a driver that conforms.
LARGEST = 3e-5

_TEXT = """#version 430 core
const float X[%(nodes)d] = float[](%(places)s);
const float W[%(nodes)d] = float[](%(weights)s);
uniform sampler2D rows;
out vec4 result;

float own_sinh(float x) {
    if (abs(x) > 1.0) { float e = exp(abs(x)); return sign(x) * 0.5 * (e - 1.0 / e); }
    float s = x * x;
    return x * (1.0 + s / 6.0 * (1.0 + s / 20.0 * (1.0 + s / 42.0 * (1.0 + s / 72.0 * (1.0 + s / 110.0)))));
}

float own_asinh(float x) {  // of x >= 0: a guess, and a step of Newton's
    float y = x < 0.5 ? x * (1.0 - x * x / 6.0) : log(x + sqrt(x * x + 1.0));
    for (int k = 0; k < 2; ++k) { float s = own_sinh(y); y -= (s - x) / sqrt(1.0 + s * s); }
    return y;
}

float path(float s, float r, float h) { return s >= 0.0 ? (s + r) / h : h / (r - s); }

float integral(float foot, float h, float x0, float x1, float sigma, float g) {
    float scale = g > 0.0 ? (1.0 - g) / (1.0 + g) : 1.0, tail = g < 0.0 ? (1.0 - g) / (1.0 + g) : 1.0;
    float s0 = x0 - foot, s1 = x1 - foot;
    h = max(h, 1e-9 * (abs(s0) + 1e-30));
    float r0 = sqrt(s0 * s0 + h * h), e0 = path(s0, r0, h);
    float reach = min(20.0 / max(sigma * h, 1e-38), 1e7 * (tail + e0));
    bool clipped = x1 > 1e30;
    float difference = reach, e1 = e0 + reach;
    if (!clipped) {
        float r1 = sqrt(s1 * s1 + h * h), end = path(s1, r1, h);
        if (end <= e0 + reach) { e1 = end; difference = (x1 - x0) * (e0 + e1) / (r0 + r1); }
    }
    float f = e0 / scale, f1 = e1 / scale, c = sqrt(f * f + 1.0), c1 = sqrt(f1 * f1 + 1.0);
    float width = own_asinh((difference / scale) * ((f + f1) / (f1 * c + f * c1)));
    float count = ceil(max(width / (g >= 0.0 ? %(forward)s : %(backward)s), sigma * h * scale * c * width / %(depth)s));
    int panels = int(clamp(count, 1.0, %(most)d.0));
    float part = width / float(panels), depth = 0.0, total = 0.0, a = (1.0 + g) / (1.0 - g), b = a / (1.0 - g);
    for (int panel = 0; panel < panels; ++panel) {
        for (int k = 0; k <= %(nodes)d; ++k) {
            float half_sinh = own_sinh(0.5 * part * (k < %(nodes)d ? X[k] : 1.0));
            float less = 2.0 * half_sinh * half_sinh, sh = 2.0 * half_sinh * sqrt(half_sinh * half_sinh + 1.0);
            float more = f * less + c * sh, at = f + more, cosh_at = c + (f * sh + c * less);
            if (k == %(nodes)d) { f = at; c = cosh_at; depth += sigma * h * scale * more; break; }
            float square = scale * at * scale * at, inverse = 1.0 / (square * a * a + 1.0);
            float density = sqrt(square * inverse + inverse) * inverse * cosh_at * b;
            total += W[k] * density * exp(-min(depth + sigma * h * scale * more, 80.0));
        }
    }
    return total / float(panels) * width * scale * (2.0 / h) * exp(-sigma * (x0 + r0));
}

void main() {
    vec4 ray = texelFetch(rows, ivec2(gl_FragCoord.x, 0), 0), medium = texelFetch(rows, ivec2(gl_FragCoord.x, 1), 0);
    result = vec4(integral(ray.x, ray.y, ray.z, ray.w, medium.x, medium.y));
}
"""


def driver_error(host: ShaderHost) -> float:
    """Return the largest relative error of a driver on the certified integrals; infinite where one is not finite."""
    with certified_data("airlight_integral.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["phase"] in ("isotropic", "hg")]
    columns = [[float(row[name]) for row in rows] for name in ("t", "h", "x0", "x1", "sigma_t", "g")]
    given = np.zeros((2, len(rows), 4), dtype=np.float32)
    given[0], given[1, :, :2] = np.stack(columns[:4], axis=1), np.stack(columns[4:], axis=1)
    given[0, :, 3] = np.minimum(given[0, :, 3], 3e38)
    places, weights = zip(*unit_nodes(_NODES), strict=True)
    forward, backward = HenyeyGreenstein.panels
    filled: dict[str, Any] = {"nodes": _NODES, "most": _MOST, "depth": _DEPTH, "forward": forward, "backward": backward}
    filled |= {"places": ", ".join(map(repr, places)), "weights": ", ".join(map(repr, weights))}
    stage = {"name": "rows", "text": _TEXT % filled, "kind": "picture", "size": [len(rows), 1], "format": "rgba32f"}
    said, _ = host.ask("open", stages=[stage])
    if "log" in said:
        return math.inf
    _, image = host.ask("frame", {"texture rows": given}, reset=True, frames=1, uniforms={})
    error = np.abs(image[0, :, 0] / np.array([float(row["value"]) for row in rows]) - 1)
    return float(error.max()) if np.isfinite(error).all() else math.inf
