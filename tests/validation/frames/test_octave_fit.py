# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the fit of octaves finds the constants that made an image, and says what the noise of a truth leaves."""

import json
import re

import numpy as np
import pytest

from analytic.errors import InputError
from realtime.frame.renderer import frame_renderer, render_frame
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import read_scene
from reference.storage.exr import Image, write_exr
from reports.commands.main import run
from tests.helpers.clouds import loaded
from validation.frames.octave_fit import fit_octaves
from validation.scenes.loading import load_scene

pytestmark = pytest.mark.usefixtures("variant")

CONSTANTS = {"extinction": 0.31, "contribution": 0.62, "anisotropy": 0.44}
FEW = {"octaves": 3, "steps": 8}


def scene_and_truth():
    read = read_scene(loaded())
    return read, render_frame(frame_renderer(read, METHODS["cloud-octaves"], **CONSTANTS, **FEW)).airlight


@pytest.mark.claim("octave-fit")
def test_constants_that_made_an_image_are_found_again():
    read, truth = scene_and_truth()
    fit = fit_octaves(read, truth, parameters=FEW)
    assert fit.noise is None
    assert (fit.octaves, fit.steps) == (3, 8)
    assert {name: getattr(fit.fitted, name) for name in CONSTANTS} == pytest.approx(CONSTANTS, abs=5e-3)
    assert fit.fitted.relative_rmse < 1e-3 < fit.halved.relative_rmse
    assert fit.halved.extinction == fit.halved.contribution == fit.halved.anisotropy == 0.5


def test_noise_of_the_truth_is_told():
    read, truth = scene_and_truth()
    error = np.full_like(truth, 0.02 * truth.mean())
    noisy = truth + np.random.default_rng(8).normal(size=truth.shape) * error
    fit = fit_octaves(read, noisy, standard_error=error, parameters=FEW)
    assert fit.noise == pytest.approx(0.02, rel=0.01)
    assert fit.fitted.relative_rmse == pytest.approx(0.02, rel=0.15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameters": {"extinction": 0.5}}, "got extinction, which is fitted"),
        ({"truth": np.ones((4, 4, 3))}, "the truth has 4 x 4 pixels, the scene 16 x 12"),
        ({"truth": np.zeros((12, 16, 3))}, "the truth has no airlight"),
    ],
)
def test_what_cannot_be_fitted_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        fit_octaves(read_scene(loaded()), **({"truth": np.ones((12, 16, 3))} | change))


@pytest.mark.slow
def test_the_command_prints_the_constants_of_an_image(tmp_path, capsys):
    truth, few = tmp_path / "truth.exr", ["--set", "steps=2", "--set", "octaves=2"]
    read = read_scene(load_scene("cumulus", (8, 6)).scene)
    frame = render_frame(frame_renderer(read, METHODS["cloud-octaves"], steps=2, octaves=2))
    write_exr(truth, Image({"airlight": frame.airlight}, None, {}))
    fit = ["bench", "cumulus", "--fit-octaves", "--against", str(truth), *few]
    assert run([*fit, "--json"]) == 0
    (printed,) = json.loads(capsys.readouterr().out)["fits"]
    assert (printed["scene"], printed["size"], printed["truth"]) == ("cumulus", [8, 6], str(truth))
    assert printed["halved"]["relative_rmse"] < 1e-5


@pytest.mark.slow
def test_the_truth_is_that_of_paths_where_none_is_given(capsys):
    assert run(["bench", "cumulus", "--fit-octaves", "--size", "8x6", "--set", "steps=2", "--set", "octaves=2"]) == 0
    printed = capsys.readouterr().out
    line = (
        r"airlight render cumulus --method cloud-octaves --set extinction=[\d.]+ --set contribution=[\d.]+ --set aniso"
    )
    assert re.search(line, printed)
    assert re.search(r"halved +0\.5 +0\.5 +0\.5 +[\d.]+ +-?[\d.]+ +[\d.]+", printed)


def test_options_that_do_not_go_together(tmp_path, capsys):
    image = tmp_path / "image.exr"
    write_exr(image, Image({"airlight": np.ones((4, 4, 3), dtype=np.float32)}, None, {}))
    for words, message in (
        (["bench", "--against", str(image)], "--scaling or --fit-octaves"),
        (["bench", "cumulus", "cloud-slab", "--fit-octaves", "--against", str(image)], "one image for 2 scenes"),
        (["bench", "cumulus", "--fit-octaves", "--against", str(image), "--set", "extinct=1"], "extinction"),
        (["bench", "sphere-spot", "--fit-octaves", "--against", str(image)], "has no clouds"),
    ):
        assert run(words) == 2
        assert message in capsys.readouterr().err
