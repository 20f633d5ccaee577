# SPDX-License-Identifier: BSD-3-Clause
"""Claim: errors, edges, flicker and steps of Ali's figures are what the page of the
experiment says, by hand.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.papers import soft_shafts
from airlight.validation.papers.soft_shafts import RENDERINGS, VARIANTS, Reference
from airlight.validation.scenes.loading import load_scene

HEIGHT, WIDTH = 8, 32


def reference() -> Reference:
    column = np.linspace(1.0, 2.0, WIDTH)
    image = np.broadcast_to(column[None, :, None], (HEIGHT, WIDTH, 3)).copy()
    penumbra = np.zeros((HEIGHT, WIDTH), dtype=bool)
    penumbra[:, 4:] = True
    return Reference(image, penumbra)


def test_errors_are_relative_in_the_penumbra_and_without_a_strip():
    of = reference()
    image = of.image.copy()
    image[:, :4] = 99.0  # outside of the penumbra
    image[:, 10:12] += 0.3  # strip 5 of 16
    mean = of.image[:, 4:].mean()
    assert of.error(image) == pytest.approx(0.3 * np.sqrt(2 / 28) / mean)
    assert of.error(image, 5) == 0
    without = np.delete(of.image[:, :, 0], [20, 21], axis=1)[0, 4:]
    assert of.error(image, 10) == pytest.approx(0.3 * np.sqrt(2 / 26) / without.mean())


def test_a_ratio_of_errors_has_the_interval_of_a_jackknife():
    of, random = reference(), np.random.default_rng(1)
    noise = random.normal(size=of.image.shape)
    exact = of.ratio(of.image + 2 * noise, of.image + noise)
    assert exact[:3] == pytest.approx((2.0, 2.0, 2.0))
    other = random.normal(size=of.image.shape)
    found = of.ratio(of.image + 2 * other, of.image + noise)
    # Each error is that of 672 values: the ratio of two has the relative standard deviation
    # 1/sqrt(672), t_15 is 2.13.
    assert found.high - found.value == pytest.approx(found.value - found.low)
    assert found.high - found.value == pytest.approx(2.13 * 2 / np.sqrt(672), rel=0.5)


def test_edges_are_gradients_over_those_of_the_reference():
    row, column = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    green = 0.01 * column**2 + 0.001 * row * column  # steepest on the right
    image = np.stack([0 * green, green, 0 * green], axis=-1)
    of = Reference(image, np.ones((HEIGHT, WIDTH), dtype=bool))
    assert of.edges(np.where(column[..., None] > 20, 0.25, 3.0) * image) == pytest.approx(0.25)


def test_steps_at_equal_time_are_linear_in_the_times():
    times = {
        name: SimpleNamespace(median_ms=ms)
        for name, ms in {"R1": 130.0, "R2": 12.0, "R3": 14.0, "R4": 22.0}.items()
    }
    chosen = soft_shafts._at_equal_time(times)  # 118 steps take 118 ms
    assert chosen == {
        "R2, equal time": {"steps": 42, "filter": "none"},
        "R3, equal time": {"steps": 40, "filter": "gauss"},
    }


def test_the_light_of_flicker_moves_in_equal_steps(variant, monkeypatch):
    scene = read_scene(load_scene("fence", (8, 6)).scene)
    middles = []

    def rendered(renderer):
        (light,) = renderer.scene.area_lights
        middles.append(np.array(light.middle, dtype=float))
        n = (len(middles) - 1) % 5
        # The square of the frame's number has the second difference 2, and twice that
        # for all but the exact sum.
        factor = 1.0 if len(middles) <= 5 else 3.0
        return SimpleNamespace(
            airlight=factor * n**2 * np.ones((6, 8, 3)), surface=np.zeros((6, 8, 3))
        )

    monkeypatch.setattr(soft_shafts, "render_frame", rendered)
    of = Reference(np.ones((6, 8, 3)), np.ones((6, 8), dtype=bool))
    assert soft_shafts._flicker(scene, of) == {name: pytest.approx(3.0) for name in ("R2", "R4")}
    steps = np.diff(np.array(middles[:5]), axis=0)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), 0.02)
    np.testing.assert_allclose(steps, steps[:1] * np.ones((4, 1)), atol=1e-12)


def test_figures_are_those_of_the_renderings_that_their_names_say(monkeypatch):
    """Images are names here, and an error is how many steps they have."""
    times = {name: SimpleNamespace(median_ms=100.0, rate=(1.0, 1.0, 1.0)) for name in RENDERINGS}
    monkeypatch.setattr(soft_shafts, "shafts_scene", lambda size: (None, Stub()))
    monkeypatch.setattr(soft_shafts, "timings", lambda scene, chosen, seconds: times)
    monkeypatch.setattr(
        soft_shafts, "rendered", lambda scene, values: tuple(sorted(values.items(), key=str))
    )
    monkeypatch.setattr(soft_shafts, "_flicker", lambda scene, reference: {"R4": 0.5})
    figures = soft_shafts.soft_shafts((8, 6))

    def image(**values):
        return tuple(sorted(values.items(), key=str))

    r4 = image(steps=32)
    assert figures["R4 error"] == 32
    assert figures["R4 flicker"] == 0.5
    assert figures["R4 edges"] == r4
    assert figures["R4 over R1"] == (r4, image(steps=150, filter="none"))
    assert figures["R4 over R3"] == (r4, image(steps=32, filter="gauss"))
    assert figures["3 points over 16"] == (
        image(**VARIANTS["3 points"]),
        image(**VARIANTS["16 points"]),
    )
    assert figures["32 taps over fewer"] == (r4, image(steps=4))


class Stub:
    """A reference whose error of an image is its number of steps, and whose ratio is the pair."""

    def error(self, image) -> float:
        return dict(image).get("steps", 0)

    def ratio(self, above, below):
        return above, below

    def edges(self, image):
        return image
