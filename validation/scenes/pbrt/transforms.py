# SPDX-License-Identifier: BSD-3-Clause
"""The transforms of pbrt as matrices that multiply columns, (4, 4)."""

from __future__ import annotations

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.scenes.pbrt.directives import Directive


def is_transform(directive: Directive) -> bool:
    """Return whether a directive changes the current transform by numbers of its own."""
    return directive.name in (
        *("Identity", "Translate", "Scale", "Rotate", "LookAt", "Transform", "ConcatTransform"),
    )


def transformed(ctm: Array, directive: Directive) -> Array:
    """Return the current transform after a directive."""
    numbers: Array = np.array(directive.numbers, dtype=np.float64)
    match directive.name:
        case "Identity":
            return np.eye(4)
        # pbrt lists matrices column by column.
        case "Transform":
            return numbers.reshape(4, 4).T
        case "ConcatTransform":
            return ctm @ numbers.reshape(4, 4).T
        case "Translate":
            moved = np.eye(4)
            moved[:3, 3] = numbers
            return ctm @ moved
        case "Scale":
            return ctm @ np.diag([*numbers, 1.0])
        case "Rotate":
            return ctm @ _rotation(directive, numbers[0], numbers[1:])
    return ctm @ _look_at(directive, *numbers.reshape(3, 3))


def _rotation(directive: Directive, degrees: float, axis: Array) -> Array:
    if not np.any(axis):
        raise directive.error("its axis is 0 0 0; expected a direction")
    x, y, z = axis / np.linalg.norm(axis)
    angle = np.deg2rad(degrees)
    # Rodrigues: I + sin K + (1 - cos) K^2, with the matrix K of the cross product.
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return matrix


def _look_at(directive: Directive, eye: Array, target: Array, up: Array) -> Array:
    """Return the transform from the world to a camera that looks along its z, with y up and x to
    the right, which is up x forward: pbrt's cameras are left-handed.
    """
    forward = target - eye
    right = np.cross(up, forward)
    least = 1e-12  # of the product of both lengths: the sine of the angle between them
    if not np.linalg.norm(right) > least * np.linalg.norm(up) * np.linalg.norm(forward):
        raise directive.error("it looks along its own up, or at its own place; write another up")
    forward, right = forward / np.linalg.norm(forward), right / np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(forward, right), forward, eye])
    return np.asarray(np.linalg.inv(matrix))
