# SPDX-License-Identifier: BSD-3-Clause
"""Errors of exported kernels; `python -m tests.helpers.exported` measures them for the
heads of exported texts.
"""

import json

from airlight.realtime.methods.shader.client import ShaderHost
from airlight.reports.api.export import MEASURED
from airlight.reports.machine.driver_check import driver_error

KERNELS = ("exact", "quadrature-16")
PHASES = (
    "isotropic",
    "rayleigh",
    "hazy",
    "murky",
    "hg",
    "hg-draine:5",
    "hg-draine:12",
    "hg-draine:50",
)


def measured(kernel, phase):
    """The largest error and the number of rays, in GLSL."""
    error, rays = driver_error(ShaderHost("export"), kernel, phase)
    return {"error": float(f"{error:.3g}"), "rays": rays}


if __name__ == "__main__":
    said, _ = ShaderHost("export").ask("open", stages=[])
    errors = {kernel: {phase: measured(kernel, phase) for phase in PHASES} for kernel in KERNELS}
    text = json.dumps(
        {"device": f"{said['device']}, {said['version']}", "errors": errors}, indent=1
    )
    MEASURED.write_text(text + "\n", encoding="utf-8")
