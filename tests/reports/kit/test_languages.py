# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the kit has the certified rays in each language, a right function passes in each, and one
with a fault fails.
"""

import csv
import json
import re
import shutil
import subprocess

import pytest

from airlight.realtime.methods.shader.client import ShaderHost
from airlight.validation.certified.files import certified_data
from tests.helpers.shaders import need_opengl

#: Faults that were put in on purpose: what the example has, and what takes its place.
FAULTS = {
    "c": {
        "4 pi missing": (" / (4 * PI));\n}", ");\n}"),
        "sign of g": ("- 2 * g * cosine", "+ 2 * g * cosine"),
        "no light path": ("light_path = r", "light_path = 0"),
    },
    "js": {
        "4 pi missing": ("(sigma_t * sum * step) / (4 * Math.PI)", "sigma_t * sum * step"),
        "sign of g": ("- 2 * g * cosine", "+ 2 * g * cosine"),
        "no light path": ("light_path = r", "light_path = 0"),
    },
    "rust": {
        "4 pi missing": ("sum * step / (4.0 * PI)", "sum * step"),
        "sign of g": ("- 2.0 * g * cosine", "+ 2.0 * g * cosine"),
        "no light path": ("light_path = r", "light_path = 0.0"),
    },
    "glsl": {
        "4 pi missing": (" / (4.0 * PI);", ";"),
        "sign of g": ("- 2.0 * g * cosine", "+ 2.0 * g * cosine"),
        "no light path": ("light_path = r", "light_path = 0.0"),
    },
}
#: Faults of `example_more.c`, by the group that has to fail.
MORE = {
    "height_fog": ("depth(row, z, (real)row->lz, r)", "0"),
    "area_point": ("+ (real)row->across", "- (real)row->across"),
    "sphere": ("PI / far", "4 * PI / far"),
    "model": ("return 1 - s2 * s2;", "return 1 - s2;"),
}
TOOLS = {"c": "cc", "js": "node", "rust": "rustc"}
NAMES = {"c": "example.c", "js": "example.mjs", "rust": "airlight_kit.rs"}
STRICT = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror"]
#: C in both precisions; the other examples have one.
CASES = [
    (language, name, real)
    for language in TOOLS
    for name in FAULTS[language]
    for real in ("double", "float")
    if real == "double" or language == "c"
]
#: A plain quadrature as an author of a shader would write it, in a variable without overflow.
SHADER = """#define AL_KIT_YOURS
const float PI = 3.14159265;
float path_of(float s, float h) {
    float r = sqrt(s * s + h * h);
    return s < 0.0 ? h / (r - s) : (s + r) / h;
}
float radiance(float foot, float height, float x0, float x1, float sigma_t, float g) {
    float w0 = log(path_of(x0 - foot, height));
    float w1 = x1 > 1e30 ? max(w0, 0.0) + 20.0 : log(path_of(x1 - foot, height));
    float step_size = (w1 - w0) / 3000.0;
    float sum = 0.0;
    for (int i = 0; i < 3000; i += 1) {
        float up = exp(w0 + (float(i) + 0.5) * step_size);
        float r = 0.5 * height * (up + 1.0 / up);
        float light_path = r;
        float x = foot + 0.5 * height * (up - 1.0 / up);
        float cosine = (1.0 - up * up) / (1.0 + up * up);
        float base = 1.0 + g * g - 2.0 * g * cosine;
        float phase = (1.0 - g * g) / (base * sqrt(base));
        sum += exp(-sigma_t * (x + light_path)) * phase / r;
    }
    return sigma_t * sum * step_size / (4.0 * PI);
}
float al_integral(float foot, float height, float x0, float x1, float sigma_t, float g) {
    return radiance(foot, height, x0, x1, sigma_t, g) * 4.0 * PI / sigma_t;
}
"""


def need(tool):
    if not shutil.which(tool):
        pytest.skip(f"{tool} is not installed")


def built(kit, folder, language, text, *, real="double"):
    """Write the text of an example beside the kit, build it and run it; return status and output."""
    need(TOOLS[language])
    for name in ("airlight_kit.h", "airlight_kit.mjs"):
        shutil.copy(kit / name, folder)
    path = folder / NAMES[language]
    path.write_text(text)
    program = str(folder / "program")
    build = {
        "c": ["cc", *STRICT, f"-Dreal={real}", str(path), "-lm", "-o", program],
        "rust": ["rustc", "-O", "--test", str(path), "-o", program],
    }
    if language in build:
        made = subprocess.run(build[language], capture_output=True, text=True, cwd=folder)
        assert made.returncode == 0, made.stderr
    command = ["node", str(path)] if language == "js" else [program]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    return ran.returncode, ran.stdout + ran.stderr


def faulty(text, fault):
    """Return a text with a fault, whose place it has once."""
    before, after = fault
    assert text.count(before) == 1
    return text.replace(before, after)


@pytest.mark.claim("kit-languages", tolerance="that of the kit")
@pytest.mark.parametrize(
    ("language", "real"), [("c", "double"), ("c", "float"), ("js", "double"), ("rust", "double")]
)
def test_a_right_function_passes(kit, tmp_path, language, real):
    text = (kit / NAMES[language]).read_text()
    status, told = built(kit, tmp_path, language, text, real=real)
    assert status == 0, told


@pytest.mark.parametrize("real", ["double", "float"])
def test_right_functions_of_all_other_groups_pass(kit, tmp_path, real):
    text = (kit / "example_more.c").read_text()
    status, told = built(kit, tmp_path, "c", text, real=real)
    assert status == 0, told
    assert set(re.findall(r"(\w+): (\d+) of \2 rays pass, 0 skipped", told)) == {
        ("height_fog", "104"),
        ("area_point", "5"),
        ("sphere", "5"),
        ("model", "125"),
    }


@pytest.mark.claim("kit-languages", tolerance="that of the kit")
@pytest.mark.parametrize(("language", "name", "real"), CASES)
def test_a_fault_fails(kit, tmp_path, language, name, real):
    text = faulty((kit / NAMES[language]).read_text(), FAULTS[language][name])
    status, told = built(kit, tmp_path, language, text, real=real)
    assert status != 0
    assert "FAIL ray line " in told
    if name == "4 pi missing":
        assert told.count("ratio 12.566") > 150  # 4 pi, on every ray


@pytest.mark.claim("kit-languages", tolerance="that of the kit")
@pytest.mark.parametrize("group", MORE)
def test_a_fault_fails_its_group_alone(kit, tmp_path, group):
    text = faulty((kit / "example_more.c").read_text(), MORE[group])
    status, told = built(kit, tmp_path, "c", text)
    assert status != 0
    assert set(re.findall(r"FAIL (\w+) line", told)) == {group}


def test_a_mirror_without_a_function_judges_nothing_and_fails(kit, tmp_path):
    text = (kit / "example.c").read_text()
    text = re.sub(r"    mirror\.(ray|foot) = .*\n", "", text)
    text = text.replace("int main(", "void *used[] = {(void *)&ray};\nint main(")
    path = tmp_path / "example.c"
    path.write_text(text)
    need("cc")
    program = str(tmp_path / "program")
    subprocess.run(["cc", "-I", str(kit), str(path), "-lm", "-o", program], check=True)
    assert subprocess.run([program], capture_output=True).returncode != 0


@pytest.mark.parametrize(
    ("change", "own", "failed"),
    [("value", "0.0", 0), ("1.002 * value", "0.01", 0), ("1.02 * value", "0.01", 201)],
)
def test_a_tolerance_of_the_user_is_kept(kit, tmp_path, change, own, failed):
    text = faulty((kit / "example.c").read_text(), ("return value * 4", f"return {change} * 4"))
    text = faulty(text, ("sizeof(float), 0.0)", f"sizeof(float), {own})"))
    status, told = built(kit, tmp_path, "c", text)
    assert (status != 0) == (failed > 0)
    assert told.count("FAIL") == failed


def test_rows_that_are_skipped_are_not_judged(kit, tmp_path):
    start = "static double ray(const al_ray_row *row) {\n"
    skip = "    if (row->phase == AL_PHASE_HG) {\n        return AL_SKIP;\n    }\n"
    text = faulty((kit / "example.c").read_text(), (start, start + skip))
    status, told = built(kit, tmp_path, "c", text)
    assert status == 0
    assert "ray: 90 of 90 rays pass, 45 skipped" in told
    nothing = faulty(text, ("row->phase == AL_PHASE_HG", "1"))
    nothing = faulty(nothing, ("    mirror.foot = foot;\n", ""))
    assert built(kit, tmp_path, "c", nothing)[0] != 0


def test_what_is_no_number_fails(kit, tmp_path):
    text = faulty((kit / "example.c").read_text(), ("return value * 4", "return NAN * value * 4"))
    status, told = built(kit, tmp_path, "c", text)
    assert status != 0
    assert told.count("FAIL") == 201


def test_the_rows_have_the_words_of_the_certified_files(kit, rows):
    """By lines of the files: inputs and values are the same words."""
    groups = json.loads((kit / "airlight_kit.json").read_text(), parse_float=str)["groups"]
    for group in groups:
        if not group["file"].endswith(".csv"):
            continue
        with certified_data(group["file"]).open(newline="") as stream:
            given = dict(enumerate(csv.DictReader(stream), start=2))
        for row in group["rows"]:
            certified = given[row["line"]]
            for name in group["columns"]:
                cell = (
                    certified[{"foot": "t", "height": "h"}.get(name, name)]
                    if (group["name"] == "foot")
                    else certified[name]
                )
                assert ("inf" if row[name] is None else str(row[name])) == cell
            assert row["value"] == certified["value"]
    assert sum(map(len, rows.values())) == 440


def test_the_rows_of_javascript_and_rust_are_those_of_json(kit, rows):
    need("node")
    script = (
        f"import {{ rowsOf }} from '{kit}/airlight_kit.mjs';"
        f"const names = {json.dumps(list(rows))};"
        "const all = Object.fromEntries(names.map((name) => [name, rowsOf(name)]));"
        "console.log(JSON.stringify(all));"
    )
    command = ["node", "--input-type=module", "--eval", script]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    # JSON has no infinity: JavaScript writes null for it.
    assert json.loads(ran.stdout) == rows
    text = (kit / "airlight_kit.rs").read_text()
    for name, expected in rows.items():
        kind = name.title().replace("_", "")
        found = re.findall(rf"^    {kind} \{{ (line: .*) \}},$", text, flags=re.MULTILINE)
        for line, row in zip(found, expected, strict=True):
            cells = dict(cell.split(": ") for cell in line.split(", "))
            read = {
                key: json.loads(word.replace("f64::INFINITY", "null"))
                for key, word in cells.items()
            }
            assert read == row


def al_test(text):
    """Return what `al_test` of a text gives, and its tolerance."""
    main = "out vec4 result;\nvoid main() { result = vec4(al_test(), AL_TOLERANCE, 0.0, 1.0); }\n"
    host = ShaderHost("export")
    stage = {"name": "kit", "kind": "picture", "size": [1, 1], "format": "rgba32f"}
    host.ask("open", stages=[stage | {"text": f"#version 430 core\n{text}{main}"}])
    _, image = host.ask("frame", {}, reset=True, frames=1, uniforms={})
    return image[0, 0, :2]


@pytest.mark.claim("kit-languages", tolerance="that of the kit, below 1e-4")
@pytest.mark.parametrize("mirror", ["", SHADER])
def test_a_right_shader_passes(kit, mirror):
    need_opengl()
    error, tolerance = al_test(mirror + (kit / "airlight_kit.glsl").read_text())
    assert 0 < error < tolerance < 1e-4


@pytest.mark.claim("kit-languages", tolerance="that of the kit, below 1e-4")
@pytest.mark.parametrize("name", FAULTS["glsl"])
def test_a_shader_with_a_fault_fails(kit, name):
    need_opengl()
    mirror = faulty(SHADER, FAULTS["glsl"][name])
    error, tolerance = al_test(mirror + (kit / "airlight_kit.glsl").read_text())
    assert error > 0.1 > tolerance


@pytest.mark.parametrize("mirror", ["", SHADER])
@pytest.mark.parametrize(
    "start", ["#version 450\n", "#version 300 es\nprecision highp float;\nprecision highp int;\n"]
)
def test_glslang_compiles_the_shader(kit, tmp_path, start, mirror):
    need("glslangValidator")
    path = tmp_path / "kit.frag"
    main = "out vec4 o;\nvoid main() { o = vec4(al_test()); }\n"
    place = "layout(location = 0) " if "450" in start else ""
    path.write_text(start + mirror + (kit / "airlight_kit.glsl").read_text() + place + main)
    command = ["glslangValidator", "-S", "frag", str(path)]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert ran.returncode == 0, ran.stdout
