# SPDX-License-Identifier: BSD-3-Clause
"""One kernel with ray tracing, run by `airlight doctor` in a process of its own; prints what it found as JSON."""

import json
import sys
import time
from pathlib import Path


def main() -> None:
    """Cast a ray at a sphere in the chosen variant and check where it meets it."""
    from reports.machine.environment import activate

    start = time.perf_counter()
    variant = activate()
    import drjit as dr
    import mitsuba as mi

    from reference.scene.shadow_epsilon import measure_shadow_epsilon

    scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "radius": 0.5}})
    towards = scene.ray_intersect(mi.Ray3f(mi.Point3f([0, 3], 0, -2), mi.Vector3f(0, 0, 1)))
    distances = towards.t.numpy().tolist()
    if abs(distances[0] - 1.5) > 1e-5 or distances[1] < 1e30:
        sys.exit(f"wrong result: distances {distances}, wanted 1.5 and infinity")
    facts = {
        "variant": variant,
        "threads": dr.thread_count(),
        "library": _loaded_llvm(),
        "epsilon": measure_shadow_epsilon(),
        "seconds": time.perf_counter() - start,
    }
    print(json.dumps(facts))


def _loaded_llvm() -> str | None:
    """Return the libLLVM that this process really loaded, where the system tells."""
    try:
        lines = Path("/proc/self/maps").read_text().splitlines()
    except OSError:
        return None
    return next((line.split(maxsplit=5)[5] for line in lines if "libLLVM" in line), None)


if __name__ == "__main__":
    main()
