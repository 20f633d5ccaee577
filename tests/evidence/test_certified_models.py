# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the terms of a model, as the quadrature has them, agree with certified values."""

import csv
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.height_fog import HeightFog, Layer, height_fog_sun
from airlight.analytic.phase import HenyeyGreenstein
from airlight.reference.quadrature.fields import field_of
from airlight.reference.quadrature.integrate import Paths, Terms
from airlight.reference.quadrature.model_terms import Route, lamp_terms
from airlight.reference.scene.model import Model
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import read_reference
from airlight.reference.visibility.planes import rays_at
from airlight.validation.certified.files import certified_data
from tests.helpers.scenes import tiny_scene


def rows(light):
    with certified_data("model_rays.csv").open(newline="") as file:
        return [row for row in csv.DictReader(file) if row["light"] == light]


def words(row):
    """Return the law and the window of a row as the words of a model."""
    length, power, scale = (row[name] for name in ("length", "power", "scale"))
    law = {
        "power": f"power:{power}",
        "softened": f"softened:{float(length) ** 2!r}:{scale}",
        "clamped": f"clamped:{length}:{power}",
        "sphere": f"sphere:{length}",
    }[row["law"]]
    return law, "none" if row["window"] == "none" else f"{row['window']}:{row['end']}"


@pytest.mark.claim("models", tolerance="1e-10: the relative tolerance of a sum in the quadrature")
def test_lamps_by_laws_ranges_and_paths(variant):
    read, seen = read_reference(mi.load_dict(tiny_scene(ball=None, floor=None))), 0
    for row in rows("lamp"):
        number = {
            name: float(row[name])
            for name in ("foot", "height", "x0", "x1", "sigma_t", "g", "a", "b", "path", "value")
        }
        law, window = words(row)
        medium = replace(
            read.medium,
            sigma_t=np.full(3, number["sigma_t"]),
            albedo=np.ones(3),
            phase=HenyeyGreenstein(number["g"]),
        )
        # The ray goes along z from the origin, the light stands beside it.
        reference = replace(
            read,
            medium=medium,
            origin=np.zeros(3),
            direction=np.array([[0.0, 0.0, 1.0]]),
            model=Model(law=law, range=window),
        )
        light = ReferenceLight(np.array([number["height"], 0.0, number["foot"]]), np.ones(3))
        rays = rays_at(reference.origin, reference.direction, light.position)
        stretches = np.array([0]), np.array([number["x0"]]), np.array([number["x1"]])
        paths = Paths(number["a"], number["b"], number["path"])
        route = Route(np.zeros(1), np.array([np.inf]), paths)
        lamp = lamp_terms(reference, light, rays, stretches, route)
        terms = Terms(lamp.profile, lamp.law, paths)
        value, error = field_of(reference).sums(
            lamp.rays, lamp.stretches, np.array([np.inf]), terms
        )
        expected = number["sigma_t"] * number["value"] / (4 * np.pi)
        assert value[0, 0] == pytest.approx(expected, rel=1e-10, abs=1e-300), row
        # The stated error holds, but for roundings of r/R where a range ends.
        assert abs(value[0, 0] - expected) <= error[0, 0] + 1e-14 * expected, row
        seen += 1
    assert seen == 320


@pytest.mark.claim("models", tolerance="2e-13: roundings of depths, which exponents carry")
def test_suns_by_fractions_of_the_depths():
    for row in rows("sun"):
        number = {name: float(cell) for name, cell in row.items() if name not in _WORDS}
        fog = HeightFog((Layer(number["sigma_t"], 0.0, number["H"]),))
        value = height_fog_sun(
            fog,
            0.0,
            number["rise"],
            number["x0"],
            number["x1"],
            sun=number["mu"],
            phase=1.0,
            camera=number["a"],
            light=number["b"],
        )
        assert float(value) == pytest.approx(number["value"], rel=2e-13), row


_WORDS = ("light", "law", "window")
