# SPDX-License-Identifier: BSD-3-Clause
"""The light of a uniform sky: against integrals that know no sun, other estimators, and
where nothing of it arrives.
"""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, quad, simpson
from scipy.special import expn

from airlight.errors import InputError
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from tests.helpers.height_fog import LAMP

SKY = '<emitter type="constant" id="sky"><rgb name="radiance" value="0.2, 0.3, 0.4"/></emitter>'
RADIANCE, ALBEDO = np.array([0.2, 0.3, 0.4]), 0.83
SIGMA_T, RADIUS = 0.41, 1.7
LAYER = {"sigma_1": 0.31, "z_1": 0.4, "H_1": 1.9}
FLOOR, CAP = -0.7, 29.3
HOMOGENEOUS = f'<medium type="homogeneous" id="fog"><float name="sigma_t" value="{SIGMA_T}"/>'
LAYERED = f"""<medium type="heterogeneous" id="fog"><volume type="heightfog" name="sigma_t">
    {"".join(f'<float name="{name}" value="{value}"/>' for name, value in LAYER.items())}
    <transform name="to_world"><scale x="40" y="40" z="{CAP - FLOOR}"/><translate z="{FLOOR}"/></transform></volume>"""
BALL = """<shape type="sphere" id="drop"><float name="radius" value="{}"/><bsdf type="null"/>
    <ref name="interior" id="fog"/></shape>"""
STONE = '<shape type="cube" id="stone"><transform name="to_world"><scale value="0.4"/></transform></shape>'
INSIDE = '<ref name="medium" id="fog"/>'


def reference_of(tmp_path, medium, *parts, camera=INSIDE):
    path = tmp_path / "sky.xml"
    path.write_text(
        f"""<scene version="3.0.0">{medium}<float name="albedo" value="{ALBEDO}"/></medium>
    <sensor type="perspective"><float name="fov" value="61"/>{camera}
        <transform name="to_world"><lookat origin="-3.1, -2.3, 1.1" target="0.1, 0.2, 0.3" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="6"/><integer name="height" value="4"/></film></sensor>
    {"".join(parts)}</scene>"""
    )
    return read_reference(load_scene(str(path)).scene)


def close(image, wanted):
    """Within six of the standard errors that are stated, which Student's 7 degrees
    exceed once in 2000 pixels.
    """
    got, error = (values.reshape(-1, 3)[:, 0] for values in (image.airlight, image.airlight_se))
    assert (np.abs(got - wanted) <= 6 * error + 1e-7 * wanted).all()
    assert error.mean() < 5e-3 * wanted.mean()


@pytest.mark.claim(
    "sky-light", tolerance="six stated standard errors, each 0.5 % of the mean at most"
)
def test_in_height_fog_it_is_the_exponential_integral(variant, tmp_path):
    reference = reference_of(tmp_path, LAYERED, SKY)
    with pytest.raises(
        InputError,
        match=r"bounding box is not valid|light paths of a sun or a sky end within the fog",
    ):
        volpath_batch(reference, 0, 64)  # there are no shapes, whose size says how far a sky is
    x = np.linspace(0, 400, 200_001)
    wanted = []
    for direction in reference.direction:
        z = reference.origin[2] + x * direction[2]
        sigma_t = np.where(
            (z > FLOOR) & (z < CAP),
            LAYER["sigma_1"] * np.exp(-(z - LAYER["z_1"]) / LAYER["H_1"]),
            0.0,
        )
        left = np.exp(-cumulative_simpson(sigma_t, x=x, initial=0))
        whole = LAYER["sigma_1"] * LAYER["H_1"]
        column = [whole * np.exp(-(end - LAYER["z_1"]) / LAYER["H_1"]) for end in (z, CAP, FLOOR)]
        above, below = np.maximum(column[0] - column[1], 0), np.maximum(column[2] - column[0], 0)
        wanted.append(simpson(sigma_t * left * 0.5 * (expn(2, above) + expn(2, below)), x=x))
    close(
        quadrature_image(reference, plan=PointPlan(most=32)),
        ALBEDO * RADIANCE[0] * np.array(wanted),
    )


@pytest.mark.slow
@pytest.mark.claim(
    "sky-light", tolerance="six stated standard errors, each 0.5 % of the mean at most"
)
def test_in_a_ball_of_fog_it_is_a_mean_over_chords(variant, tmp_path):
    reference = reference_of(tmp_path, HOMOGENEOUS, SKY, BALL.format(RADIUS), camera="")

    def arriving(r):
        return (
            quad(
                lambda mu: np.exp(SIGMA_T * (r * mu - np.sqrt(RADIUS**2 - r**2 * (1 - mu**2)))),
                -1,
                1,
            )[0]
            / 2
        )

    def airlight(direction):
        foot = -reference.origin @ direction
        half = RADIUS**2 - reference.origin @ reference.origin + foot**2
        if half <= 0:
            return 0.0
        half = np.sqrt(half)

        def scattered(x):
            radius = np.sqrt(min(RADIUS**2 - half**2 + x * x, RADIUS**2))
            return SIGMA_T * np.exp(-SIGMA_T * (x + half)) * arriving(radius)

        return quad(scattered, -half, half)[0]

    wanted = (
        ALBEDO * RADIANCE[0] * np.array([airlight(direction) for direction in reference.direction])
    )
    assert (wanted > 0).sum() > 8
    close(quadrature_image(reference, plan=PointPlan(most=32)), wanted)


@pytest.mark.claim("sky-light", tolerance="exactly nothing")
def test_through_fog_without_bounds_nothing_arrives(variant, tmp_path):
    with pytest.raises(InputError, match="light 'sky' is a sky: nothing of it arrives"):
        reference_of(tmp_path, HOMOGENEOUS, SKY)
    dark, lit = (
        quadrature_image(reference_of(tmp_path, HOMOGENEOUS, LAMP, STONE, *sky))
        for sky in ((), (SKY,))
    )
    np.testing.assert_array_equal(lit.airlight, dark.airlight)
    np.testing.assert_array_equal(lit.surface, dark.surface)
    assert lit.emitted is not None
    assert not lit.emitted.any()
