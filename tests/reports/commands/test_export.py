# SPDX-License-Identifier: BSD-3-Clause
"""`airlight export`: the text is printed or written whole; its head says how exact it is; the kit
is written whole beside nothing of others.
"""

import json
import re

import pytest

import airlight
from airlight.reports.api.export import MEASURED
from airlight.reports.commands.main import run


@pytest.mark.claim("exported-kernels")
def test_the_text_that_is_printed_is_the_file_that_is_written(tmp_path, capsys):
    asked = ["export", "exact", "--phase", "hg", "--language", "hlsl", "--test"]
    assert run(asked) == 0
    printed = capsys.readouterr().out
    target = tmp_path / "airlight.hlsl"
    assert run([*asked, "-o", str(target)]) == 0
    assert capsys.readouterr().out == f"wrote {target}\n"
    assert target.read_text() == printed
    assert run([*asked, "-o", str(target), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)["result"]
    told = said["language"], said["phase"], said["code"], said["written"]
    assert told == ("hlsl", "hg", printed, [str(target)])
    assert "airlight export exact --language hlsl --phase hg --test)" in printed
    assert len(re.findall(r"worst = al_worse\(worst, abs\(al_integral", printed)) == 8
    assert run(["export", "exact", "--phase", "hg", "--language", "hlsl"]) == 0
    plain = capsys.readouterr().out
    assert "al_test()" not in plain
    assert "airlight export exact --language hlsl --phase hg)" in plain


@pytest.mark.claim("exported-kernels")
def test_the_head_states_the_error_that_was_measured_and_none_where_none_was(capsys):
    errors = json.loads(MEASURED.read_text(encoding="utf-8"))["errors"]
    exact = airlight.export("exact", phase="rayleigh")
    assert exact.error == errors["exact"]["rayleigh"]["error"]
    assert (
        f"Largest relative error of J: {exact.error:.1e} on {errors['exact']['rayleigh']['rays']} "
        in exact.code
    )
    assert "that keeps the bounds of Vulkan at most" in exact.code
    nodes = airlight.export("quadrature-16", phase="rayleigh")
    assert f"{nodes.error:.1e}" in nodes.code
    assert "Vulkan" not in nodes.code  # that was simulated for `exact` alone
    other = airlight.export("quadrature-6", phase="rayleigh")
    assert other.error is None
    assert "not measured for this kernel and phase function; see al_test" in other.code
    assert repr(other) == "Exported(quadrature-6, rayleigh, glsl)"


@pytest.mark.parametrize("phase", ["hg:0.5", "mie:6", "tabulated"])
def test_a_phase_function_that_is_no_function_of_g_is_refused(phase, capsys):
    assert run(["export", "--phase", phase]) == 2
    assert (
        f"phase: got {phase!r}, expected isotropic, rayleigh, hazy, murky, hg"
        in capsys.readouterr().err
    )


def test_the_kit_is_written_into_an_empty_folder_and_listed(variant, tmp_path, capsys):
    folder = tmp_path / "kit"
    assert run(["export", "--kit", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert printed.endswith(f"read {folder}/README.md first\n")
    kit = airlight.export(kit=tmp_path / "other")
    names = {*kit.files, *(name for scene in kit.scenes for name in scene.files)}
    there = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    assert names == there
    assert f"wrote {len(names)} files into {folder}" in printed
    assert len(kit.scenes) == 12
    # A file that somebody may have changed is never written again.
    (folder / "example.c").write_text("mine")
    assert run(["export", "--kit", str(folder)]) == 2
    assert "which has files; expected a new or an empty folder" in capsys.readouterr().err
    assert (folder / "example.c").read_text() == "mine"


def test_a_kit_that_fails_leaves_nothing(variant, tmp_path, monkeypatch):
    def full(path, loaded):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("airlight.reports.kit.write.write_gltf", full)
    with pytest.raises(OSError, match="No space left"):
        airlight.export(kit=tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["quadrature-8"], "kernel"),
        (["--language", "wgsl"], "language"),
        (["--phase", "hg"], "phase"),
        (["--test"], "test"),
        (["-o", "kit.glsl"], "output"),
    ],
)
def test_the_kit_excludes_all_other_options(words, name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["export", *words, "--kit", "kit"]) == 2
    assert f"leave out {name}\n" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
