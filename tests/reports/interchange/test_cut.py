# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a mesh is cut at the bounds of a medium in any unit of length."""

import numpy as np
import pytest

from airlight.reference.scene.convex_bounds import Polyhedron
from airlight.reports.interchange.cut import cut_by
from airlight.reports.interchange.meshes import ShapeMesh


def area(mesh):
    first, second, third = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(second - first, third - first), axis=1).sum()


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e4])
def test_both_parts_have_their_areas(unit):
    """A margin of a micrometre put all of a scene of micrometres into the medium."""
    sides = Polyhedron(
        np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, unit), np.zeros((0, 2, 3))
    )
    # One triangle passes through two sides of the box, the other lies beyond it.
    corners = np.array([[-2.0, 0, 0], [2, 0, 0], [0, 0.5, 0], [3, 0, 0], [4, 0, 0], [3, 1, 0]])
    mesh = ShapeMesh("sheet", unit * corners, np.arange(6).reshape(2, 3), None, exact=True)
    inner, outer = cut_by(mesh, sides)
    assert area(inner) == pytest.approx(0.75 * unit**2, rel=1e-9)
    assert area(outer) == pytest.approx(0.75 * unit**2, rel=1e-9)
