# SPDX-License-Identifier: BSD-3-Clause
"""Every kernel on Dr.Jit's scalar backend, where a number is a Python float, in a process of its own."""

import json
import subprocess
import sys

SCRIPT = """
import json, sys
import mitsuba as mi
mi.set_variant("scalar_rgb")
from analytic.cases import read_cases
from realtime.errors import InputError
from realtime.rays.ray_light import RayGeometry
from realtime.kernels.registry import KERNELS
from realtime.scene.lights import Light
from realtime.scene.medium import Medium
from realtime.scene.phase import named_phase

cases, light, found = read_cases(sys.argv[1]), Light(None, None), {}
for name, kernel in KERNELS.items():
    found[name] = []
    for k in range(0, 300, 11):
        phase = named_phase(cases.phase[k], g=float(cases.g[k]) if cases.phase[k] == "hg" else None)
        medium = Medium((float(cases.sigma_t[k]),), mi.Color3f(1), phase)
        geometry = RayGeometry(float(cases.foot[k]), float(cases.height[k]), None, None)
        try:
            J = kernel.function(geometry, float(cases.x0[k]), float(cases.x1[k]), medium, light)
        except InputError:
            continue
        found[name].append(abs(float(J) / float(cases.value[k]) - 1))
print(json.dumps(found))
"""


def test_kernels_run_on_python_floats(data_folder):
    script = [sys.executable, "-c", SCRIPT, str(data_folder / "airlight_integral.csv")]
    errors = json.loads(subprocess.run(script, capture_output=True, text=True, check=True, timeout=120).stdout)
    assert max(errors["exact"]) < 1e-10
    assert len(errors["exact"]) == 28
    for name in ("quadrature", "quadrature-theta", "equiangular", "polynomial"):
        assert sorted(errors[name])[14] < 1e-3, name  # the median; what each is good for, its own tests say
    assert errors["closed-form"]
    assert errors["taylor"]
    assert errors["table"] == errors["table-tail"] == []  # refused by name: no arrays to hold a table
