# SPDX-License-Identifier: BSD-3-Clause
"""The template of `realtime.export.text` in each language.

The template is a subset of GLSL that differs from the other languages in spelling alone: one
declaration a line, braces after each `if`, no `?:`, no parameter that is assigned, no shift.
"""

import re
from collections.abc import Callable

_PRECISE = """#if !defined(GL_ES) && __VERSION__ >= 400
#define AL_PRECISE precise
#else
#define AL_PRECISE
#endif

"""
_WGSL_TYPES = {"float": "f32", "int": "i32", "vec2": "vec2<f32>", "vec3": "vec3<f32>"}
_TYPE = "(" + "|".join(_WGSL_TYPES) + ")"


def _glsl(text: str) -> str:
    # A constant array has a constructor; `precise` is a word of desktop GLSL alone, from 4.00 on.
    text = re.sub(
        r"^float (\w+)\[(\d+)\] = \((.*)\);$",
        r"const float \1[\2] = float[\2](\3);",
        text,
        flags=re.M,
    )
    return _PRECISE + text


def _hlsl(text: str) -> str:
    # A constant array of the file is static, or it would be an input of the shader.
    text = re.sub(
        r"^float (\w+)\[(\d+)\] = \((.*)\);$",
        r"static const float \1[\2] = {\3};",
        text,
        flags=re.M,
    )
    text = text.replace("floatBitsToInt(", "asint(").replace("intBitsToFloat(", "asfloat(")
    return re.sub(r"\bvec([23])\b", r"float\1", text).replace("AL_PRECISE", "precise")


def _slang(text: str) -> str:
    # Slang 2026.5.2 hands the word on to WGSL, which has none.
    return _hlsl(text.replace("AL_PRECISE ", ""))


def _wgsl(text: str) -> str:
    def function(match: re.Match[str]) -> str:
        # WGSL puts a name before its type, and the type of the result behind the parameters.
        parameters = re.sub(_TYPE + r" (\w+)", lambda m: f"{m[2]}: {_WGSL_TYPES[m[1]]}", match[3])
        return f"fn {match[2]}({parameters}) -> {_WGSL_TYPES[match[1]]} {{"

    text = text.replace("AL_PRECISE ", "")
    text = re.sub(rf"^{_TYPE} (\w+)\((.*)\) {{$", function, text, flags=re.M)
    # Private variables: a constant array may not be indexed by a variable everywhere.
    array = r"var<private> \1: array<f32, \2> = array<f32, \2>(\3);"
    text = re.sub(r"^float (\w+)\[(\d+)\] = \((.*)\);$", array, text, flags=re.M)
    text = re.sub(r"^( +)float (\w+)\[(\d+)\];$", r"\1var \2: array<f32, \3>;", text, flags=re.M)
    # Locals that are set where they are declared; then types that are called, as conversions.
    text = re.sub(rf"\b{_TYPE} (\w+) = ", lambda m: f"var {m[2]}: {_WGSL_TYPES[m[1]]} = ", text)
    text = text.replace("floatBitsToInt(", "bitcast<i32>(").replace(
        "intBitsToFloat(", "bitcast<f32>("
    )
    return re.sub(rf"\b{_TYPE}\(", lambda m: f"{_WGSL_TYPES[m[1]]}(", text)


#: By name, what makes of the template a text of the language.
LANGUAGES: dict[str, Callable[[str], str]] = {
    "glsl": _glsl,
    "hlsl": _hlsl,
    "wgsl": _wgsl,
    "slang": _slang,
}
