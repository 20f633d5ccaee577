# SPDX-License-Identifier: BSD-3-Clause
"""Three bounded media of coloured fog and a bar through them: Biri 2006, Fig. 7b and Table 2, 14 785 triangles.

The published scene, known from a sentence and a small picture, has one box in a red, a blue and a green medium. Here
the box is a long bar, and other casters lie inside, across and between the media.
"""

from typing import Any

import numpy as np

from validation.scenes.parts import (
    Mesh,
    camera,
    fog,
    grid,
    joined,
    lathe,
    medium_boundary,
    mitsuba_mesh,
    placed,
    point_light,
    rotation,
    scaled,
)
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import box, gable, gem, icosphere, prism, star, tetrahedron, torus


def three_media() -> dict[str, Any]:
    """Return three convex media, 462 triangles, closed casters within, across and between them, a floor and a wall.

    Only the floor and the wall are open; the gable of the wall makes the number of triangles odd. The camera, the lamp
    and the room are in clear air.
    """
    media = {name: medium_boundary(name, mesh, medium) for name, mesh, medium in _media()}
    casters = {name: mitsuba_mesh(name, mesh, reflectance) for name, mesh, reflectance in _casters()}
    return {
        "type": "scene",
        "sensor": camera((0.67, -6.83, 2.11), (0.13, 0.31, 1.43), fov=47.3, size=(800, 600), in_fog=False),
        "lamp": point_light((-0.43, 0.67, 4.83), (113.0, 109.0, 101.0)),
        **media,
        **casters,
        "floor": mitsuba_mesh(
            "floor", grid((-6.3, -4.1, -0.07), (12.7, 0, 0), (0, 8.3, 0), (23, 18)), (0.31, 0.30, 0.28)
        ),
        "wall": mitsuba_mesh("wall", _wall(), (0.13, 0.14, 0.16)),
    }


def _media() -> list[tuple[str, Mesh, dict[str, Any]]]:
    red = scaled(icosphere(2), (0.97, 0.79, 1.13))
    green = scaled(gem(13, 5), (0.83, 0.91, 1.03))
    return [
        (
            "red",
            placed(red, (-1.87, 0.23, 1.51), rotation((0.2, 1, 0.1), 13.7)),
            fog((0.67, 0.73, 0.79), (0.93, 0.17, 0.13)),
        ),
        (
            "green",
            placed(green, (0.13, -0.17, 1.47), rotation((1, 0.3, 0), 7.9)),
            fog((0.83, 0.61, 0.71), (0.19, 0.91, 0.23), {"type": "rayleigh"}),
        ),
        (
            "blue",
            placed(box((1.37, 1.19, 1.97)), (2.09, 0.19, 1.43), rotation((0.1, 0.2, 1), 23.3)),
            fog((1.13, 1.09, 0.97), (0.23, 0.41, 0.97), {"type": "hg", "g": 0.31}),
        ),
    ]


def _casters() -> list[tuple[str, Mesh, tuple[float, float, float]]]:
    """Return the closed casters: a bar through all three media, and others inside, between and before them."""
    level, height = np.linspace(0.0, 1.0, 41), np.linspace(0.0, 1.0, 43)
    spindle = lathe(0.023 + 0.093 * np.sin(np.pi * level) ** 2 * (1.3 + np.cos(9.1 * level)), 1.37 * level, 36)
    vase = lathe(0.11 + 0.13 * np.sin(2.3 * height + 0.4) ** 2, 0.97 * height, 36)
    slats = [placed(box((0.083, 1.61, 0.047)), (0.293 * k - 0.71, 0.03 * k, 0.0)) for k in range(6)]
    gold, white, brown = (0.67, 0.59, 0.23), (0.71, 0.69, 0.67), (0.53, 0.37, 0.29)
    return [
        ("bar", placed(box((5.93, 0.17, 0.13)), (0.07, 0.09, 1.37), rotation((0.1, 1, 0.3), 3.7)), brown),
        ("ring-within", placed(torus(0.43, 0.067, (67, 24)), (-1.83, 0.17, 1.87), rotation((1, 0.4, 0), 31.3)), gold),
        ("ring-above", placed(torus(0.31, 0.053, (59, 22)), (-1.49, 0.37, 3.19), rotation((1, 0.3, 0), 23.9)), gold),
        ("sphere", placed(scaled(icosphere(3), 0.19), (-2.23, 0.31, 2.97)), white),
        ("star", placed(prism(star(0.19, 0.47, 7), 0.091), (0.17, -0.13, 1.93), rotation((1, 0.7, 0), 21.1)), white),
        ("slats", placed(joined(slats), (0.07, 0.11, 3.13), rotation((0.3, 0.1, 1), 19.3)), brown),
        ("spindle", placed(spindle, (2.03, 0.17, 0.79), rotation((0.3, 1, 0), 11.9)), white),
        (
            "star-across",
            placed(prism(star(0.23, 0.53, 5), 0.117), (1.61, 0.11, 2.39), rotation((0.2, 1, 0), 27.7)),
            gold,
        ),
        ("vase", placed(vase, (1.03, -0.61, -0.09)), brown),
        ("tetrahedron", placed(tetrahedron(0.29), (1.07, 0.19, 2.81), rotation((1, 0.2, 0.3), 41.0)), gold),
    ]


def _wall() -> Mesh:
    return gable((-6.3, 4.2, -0.07), (12.7, 0, 0), (0, 0, 5.3), (19, 4))


SCENE = SceneRecord(
    "three-media",
    three_media,
    "Three bounded media of coloured fog, with casters inside, across and between them, 14 785 triangles.",
    "Biri, Arques, Michelin 2006, Fig. 7b and Table 2: 35 frames/s; there one box in red, blue and green, here a bar",
    Animation(("objects",), objects=("bar",)),
)
