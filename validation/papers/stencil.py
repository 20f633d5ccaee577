# SPDX-License-Identifier: BSD-3-Clause
"""The stencil of Biri 2006, sections 5 and 5.1.5, along a ray: no image is needed.

Along a ray a shadow is an interval [a, b]. Its plane at a faces the camera, that at b faces away. Planes are drawn from
the surface towards the camera: one that faces the camera adds Gamma(a) where the stencil is 1, one that faces away
subtracts Gamma(b) where it is 0. In section 5, stage 5, planes that face the camera then increment the stencil; in
5.1.5 they decrement it. Any increasing function serves as Gamma; x does.
"""

import numpy as np

_RAYS = 4000


def stencil() -> dict[str, float]:
    """Return the fraction of random rays with up to five overlapping shadows whose lit length comes out right.

    They are `section 5.1.5` and `stage 5`, by the rules that these print.
    """
    random = np.random.default_rng(65)
    rays = [_shadows(random) for _ in range(_RAYS)]
    right = {
        name: [abs(drawn(ray, step) - _lit_length(ray)) < 1e-9 for ray in rays]
        for name, step in (("section 5.1.5", -1), ("stage 5", 1))
    }
    return {name: float(np.mean(each)) for name, each in right.items()}


def _shadows(random: np.random.Generator) -> list[tuple[float, float]]:
    """Return shadows on a ray from the camera at 0, in the light, to the surface at 1."""
    pairs = np.sort(random.uniform(0, 1.3, (int(random.integers(1, 6)), 2)), axis=1)
    return [(float(a), float(b)) for a, b in pairs]


def drawn(shadows: list[tuple[float, float]], step: int) -> float:
    """Return the sum that is drawn; `step` is what planes that face the camera add to the stencil, others take it."""
    level = sum(a < 1 < b for a, b in shadows)
    planes = sorted([(a, True) for a, _ in shadows] + [(b, False) for _, b in shadows], reverse=True)
    total = 1.0 if level == 0 else 0.0
    for x, front in planes:
        if x >= 1:
            continue
        if level == (1 if front else 0):
            total += x if front else -x
        level += step if front else -step
    return total


def _lit_length(shadows: list[tuple[float, float]]) -> float:
    """Return how much of the ray lies in no shadow, by cutting it at all ends."""
    cuts = np.unique(np.clip([0.0, 1.0, *(end for pair in shadows for end in pair)], 0, 1))
    middles = 0.5 * (cuts[1:] + cuts[:-1])
    lit = [not any(a < x < b for a, b in shadows) for x in middles]
    return float(np.sum(np.diff(cuts)[lit]))
