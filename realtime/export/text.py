# SPDX-License-Identifier: BSD-3-Clause
"""The kernels `exact` and `quadrature-N` as shader code: one template, and the constants of
the Python kernels in it.

The pages of `realtime.kernels.exact` and `realtime.kernels.stepping` derive what the text computes.
`exact` integrates all segments by panels in v; the text has no rule for short ones.

**Elementary functions are our own.** The functions of drivers may be, and are, wrong where it
matters: on llvmpipe `asinh` and `sinh` by 6 % below 1e-5, `log` by 73 % at 1 - 6e-8, `exp` by 4e-6
at -87. `al_exp` reduces its argument as Cody and Waite do, x - n hi - n lo, where hi has so few
bits that n hi is exact without a fused operation. `al_asinh` is 2 atanh(x/(1 + sqrt(1 + x^2))),
without cancellation, and a logarithm by the bits of its argument for large x.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from airlight.errors import InputError
from airlight.realtime.export.languages import LANGUAGES
from airlight.realtime.kernels.exact import DEEPEST, MOST_PANELS
from airlight.realtime.numerics.functions import EXP2, LOG2_E, SINH, unit_nodes
from airlight.realtime.scene.media.medium import OPTICAL_REACH
from airlight.realtime.scene.phase import (
    Hazy,
    HenyeyGreenstein,
    HgDraine,
    Isotropic,
    Murky,
    Phase,
    Rayleigh,
)
from airlight.realtime.scene.rule_reach import PANEL_DEPTH, PANEL_NODES

#: The largest relative error of `exact` on any device that keeps the bounds of Vulkan; a test runs
#: the text with every operation as wrong as they permit.
CONFORMING = 3e-5

#: Built-in functions that a text may call: IEEE says how they round, or they do not round.
BUILT_IN: tuple[str, ...] = (
    *(
        "abs",
        "ceil",
        "cross",
        "dot",
        "float",
        "floatBitsToInt",
        "floor",
        "int",
        "intBitsToFloat",
        "length",
        "max",
    ),
    *("min", "sqrt", "vec2", "vec3"),
)


def kernel_nodes(kernel: str) -> int | None:
    """Return the nodes of 'quadrature-N', None for 'exact'; raise
    InputError for any other kernel.
    """
    if kernel == "exact":
        return None
    # An even N up to 64 with its digits alone: no sign, no space, no point.
    name, _, words = kernel.partition("-")
    if name == "quadrature" and words.isdecimal() and 2 <= int(words) <= 64 and int(words) % 2 == 0:
        return int(words)
    raise InputError(
        f"kernel: got {kernel!r}, expected 'exact' or 'quadrature-N' with an even N from 2 to 64"
    )


def kernel_text(
    kernel: str, phase: Phase, language: str, rows: Sequence[Sequence[float]] = ()
) -> str:
    """Return the functions of a kernel in a language, without a header.

    `rows`: foot, height, x0, x1, sigma_t, g and J of rays for `al_test`, the largest relative error
    over them. Raises InputError for a kernel, a phase function or a language that cannot be
    exported.
    """
    if language not in LANGUAGES:
        raise InputError(f"language: got {language!r}, expected one of {', '.join(LANGUAGES)}")
    nodes = kernel_nodes(kernel)
    # A function stands before the functions that call it, as the languages ask.
    parts = [
        _elementary(),
        _phase(phase),
        _exact(phase) if nodes is None else _quadrature(phase, nodes),
        _ray(),
    ]
    if rows:
        parts.append(_test(rows))
    return LANGUAGES[language]("\n".join(parts))


def _number(value: float) -> str:
    """Return the shortest literal that float32 reads as the nearest to a number."""
    single = np.float32(value)  # whose `str` has fewer digits once colour-science is imported
    # Digits without an exponent, as far as they stay short.
    plain = value == 0 or 1e-4 <= abs(value) < 1e16
    return (
        np.format_float_positional(single, trim="0")
        if plain
        else np.format_float_scientific(single, trim="0")
    )


def _array(name: str, values: Iterable[float]) -> str:
    words = [_number(value) for value in values]
    return f"float {name}[{len(words)}] = ({', '.join(words)});"


def _polynomial(coefficients: Sequence[float], variable: str) -> str:
    """Return Horner's scheme, the highest power first."""
    text = _number(coefficients[0])
    for coefficient in coefficients[1:]:
        text = f"({text}) * {variable} + {_number(coefficient)}"
    return text


def _elementary() -> str:
    # al_exp: e^x = 2^n 2^f with f = (x - n ln 2) log2(e). ln 2 is the sum of two parts, the first
    # of nine bits, so that n times it is exact. The polynomial of 2^f is `exp_bounded`'s; n is
    # written into the exponent of a float32, which begins at bit 23.
    ln2_high = 355 / 512
    # al_asinh: log(x + sqrt(x^2 + 1)), or log(2 x) where the 1 is below rounding. The logarithm
    # takes the exponent of its argument apart. The rest, f, lies from sqrt(1/2), whose float32 has
    # these bits, to sqrt(2), and log f = 2 atanh((f - 1)/(f + 1)).
    root_half = 0x3F3504F3
    # 2 atanh t = 2 t (1 + t^2/3 + t^4/5 + ... + t^10/11).
    atanh = _polynomial([2 / odd for odd in range(11, 0, -2)], "q")
    return f"""// e^x, -87 <= x <= 88; relative error 2e-7.
float al_exp(float x) {{
    float y = min(max(x, -87.0), 88.0);
    float n = floor(y * {_number(LOG2_E)} + 0.5);
    AL_PRECISE float r = y - n * {_number(ln2_high)};
    AL_PRECISE float s = r - n * {_number(math.log(2) - ln2_high)};
    float f = s * {_number(LOG2_E)};
    float p = {_polynomial(EXP2, "f")};
    return p * intBitsToFloat((int(n) + 127) * 8388608);
}}

// sinh y, |y| <= 1.65.
float al_sinh(float y) {{
    float q = y * y;
    return y * ({_polynomial(SINH, "q")});
}}

// 2 atanh t, |t| <= 0.24.
float al_atanh2(float t) {{
    float q = t * t;
    return t * ({atanh});
}}

// asinh x, 0 <= x <= 1e38.
float al_asinh(float x) {{
    if (x < 0.5) {{
        return al_atanh2(x / (1.0 + sqrt(1.0 + x * x)));
    }}
    float u = 2.0 * x;
    if (x < 10000.0) {{
        u = x + sqrt(x * x + 1.0);
    }}
    int bits = floatBitsToInt(u);
    int n = (bits - {root_half}) / 8388608;
    float f = intBitsToFloat(bits - n * 8388608);
    return al_atanh2((f - 1.0) / (f + 1.0)) + float(n) * {_number(math.log(2))};
}}

// (s + r)/h without cancellation.
float al_path(float s, float r, float h) {{
    if (s >= 0.0) {{
        return (s + r) / h;
    }}
    return h / (r - s);
}}
"""


_HG = """    float sharp = abs(g);
    float side = down;
    if (g < 0.0) {
        side = up;
    }
    float base = 4.0 * sharp * side + (1.0 - sharp) * (1.0 - sharp);
    return (1.0 - g) * (1.0 + g) / (base * sqrt(base));
}
"""
_LOBE = """float al_lobe(float down, float a, float b, float c) {
    float base = a * down + b;
    return c / (base * sqrt(base));
}

"""


def _lobe(fraction: float, g: float) -> str:
    """Return a lobe of Henyey and Greenstein's, c/(a down + b)^(3/2), by constants: in float32,
    1 - g would have lost the digits of a sharp lobe.
    """
    numbers = (4 * g, (1 - g) ** 2, fraction * (1 - g) * (1 + g))
    return f"al_lobe(down, {', '.join(map(_number, numbers))})"


def _phase(phase: Phase) -> str:
    """Return `al_phase` of sin^2 and cos^2 of half the scattering angle, of mean 1."""
    start = "// The phase function, of mean 1 over the sphere; down, up = (1 -+ cos)/2.\n"
    signature = "float al_phase(float down, float up, float g) {\n"
    # g is an argument of the text.
    if isinstance(phase, HenyeyGreenstein):
        return start + signature + _HG
    if isinstance(phase, HgDraine):
        # A narrow lobe, and a wide one times constant + square cos^2; cos = up - down.
        (fraction, narrow), (_, wide) = phase.lobes
        constant, square = map(_number, phase.rise)
        more = f"({constant} + {square} * (up - down) * (up - down)) * {_lobe(1.0, wide)}"
        return f"{_LOBE}{start}{signature}    return {_lobe(fraction, narrow)} + {more};\n}}\n"
    if isinstance(phase, Hazy | Murky):
        # One high power of up = (1 + cos)/2, by squaring.
        lowest, highest = _number(phase.polynomial[0]), _number(phase.polynomial[-1])
        squares = "".join("    power = power * power;\n" for _ in range(phase.doublings))
        value = f"    return {lowest} + {highest} * power;\n"
        return f"{start}{signature}    float power = up;\n{squares}{value}}}\n"
    # The polynomial in up as it is.
    if isinstance(phase, Isotropic | Rayleigh):
        return f"{start}{signature}    return {_polynomial(phase.polynomial[::-1], 'up')};\n}}\n"
    raise InputError(
        f"phase: {phase.name!r} reads a table, which cannot be exported; expected isotropic, "
        "rayleigh, hazy, murky, hg or hg-draine:D"
    )


_TAKES = """// The airlight integral J [1/m] of a point light from x0 to x1 [m] along a ray; x1 > 1e30 is unbounded.
// foot, height [m]: al_ray; sigma_t [1/m]; g: mean cosine in (-1, 1), positive forward, of Henyey and Greenstein's
// phase function; others ignore it.
"""


def _interval(tail: str) -> str:
    """Return the lines that find E = q/h at both ends, and their
    difference without cancellation.
    """
    # `path_interval` of `realtime.kernels.exact` in float32. A height below the rounding of the
    # distances is as good as zero. The far end comes no later than where extinction, or
    # p/(1 + E^2), leaves nothing. A ray whose x1 is beyond 1e30 m has no end.
    unbounded = 1e30
    return f"""    float s0 = x0 - foot;
    float h = max(height, 1e-9 * (abs(s0) + 1e-28));
    float r0 = sqrt(s0 * s0 + h * h);
    float e0 = al_path(s0, r0, h);
    float reach = min({_number(OPTICAL_REACH)} / max(sigma_t * h, 1e-37), 1e7 * ({tail} + e0));
    float e1 = e0 + reach;
    float difference = reach;
    if (x1 <= {unbounded:g}) {{
        float s1 = x1 - foot;
        float r1 = sqrt(s1 * s1 + h * h);
        float end = al_path(s1, r1, h);
        if (end <= e1) {{
            e1 = end;
            difference = (x1 - x0) * (e0 + end) / max(r0 + r1, 1e-37);
        }}
    }}
"""


def _exact(phase: Phase) -> str:
    # d of a forward lobe, the E where a backward one ends, and the widest panel in v. For Henyey
    # and Greenstein's function they follow from g, an argument of the text; for other functions
    # they are numbers.
    if isinstance(phase, HenyeyGreenstein):
        forward, backward = (_number(reach.panel) for reach in phase.reaches())
        lobe = f"""    float forward = max(g, 0.0);
    float backward = max(-g, 0.0);
    float scale = (1.0 - forward) / (1.0 + forward);
    float tail = (1.0 + backward) / (1.0 - backward);
    float widest = {forward};
    if (g < 0.0) {{
        widest = {backward};
    }}
"""
    else:
        scale = phase.lobe_scales(float)[0]
        lobe = f"""    float scale = {_number(scale)};
    float tail = 1.0;
    float widest = {_number(phase.reach.panel)};
"""
    places, weights = zip(*unit_nodes(PANEL_NODES), strict=True)
    # `_subsegment` and `panels_mean` of `realtime.kernels.exact`: the width of the segment in v,
    # the number of panels by width and optical depth, sinh u (`sinhs`) and cosh u - 1 (`lesses`) of
    # the nodes once, both from y = sinh(u/2), and then the panels.
    return f"""{_array("AL_X", places)}
{_array("AL_W", weights)}

{_TAKES}float al_integral(float foot, float height, float x0, float x1, float sigma_t, float g) {{
{lobe}{_interval("tail")}    float f = e0 / scale;
    float f1 = e1 / scale;
    float c = sqrt(f * f + 1.0);
    float c1 = sqrt(f1 * f1 + 1.0);
    float width = al_asinh((difference / scale) * ((f + f1) / (f1 * c + f * c1)));
    float rate = sigma_t * h * scale;
    float count = ceil(max(width / widest, rate * c * width / {_number(PANEL_DEPTH)}));
    int panels = int(min(max(count, 1.0), {_number(MOST_PANELS)}));
    float part = width / float(panels);
    float sinhs[{PANEL_NODES}];
    float lesses[{PANEL_NODES}];
    for (int i = 0; i < {PANEL_NODES}; i += 1) {{
        float y = al_sinh(0.5 * part * AL_X[i]);
        sinhs[i] = 2.0 * y * sqrt(y * y + 1.0);
        lesses[i] = 2.0 * y * y;
    }}
    float y1 = al_sinh(0.5 * part);
    float sinh1 = 2.0 * y1 * sqrt(y1 * y1 + 1.0);
    float less1 = 2.0 * y1 * y1;
    float depth = 0.0;
    float total = 0.0;
    for (int k = 0; k < panels; k += 1) {{
        for (int i = 0; i < {PANEL_NODES}; i += 1) {{
            float more = f * lesses[i] + c * sinhs[i];
            float e = scale * (f + more);
            float up = 1.0 / (e * e + 1.0);
            float value = (c + (f * sinhs[i] + c * lesses[i])) * up * al_phase(e * e * up, up, g);
            total = total + AL_W[i] * value * al_exp(max(-depth - rate * more, -{_number(DEEPEST / LOG2_E)}));
        }}
        float step = f * less1 + c * sinh1;
        c = c + (f * sinh1 + c * less1);
        f = f + step;
        depth = depth + rate * step;
    }}
    return total / float(panels) * width * scale * (2.0 / h) * al_exp(-sigma_t * (x0 + r0));
}}
"""


def _quadrature(phase: Phase, nodes: int) -> str:
    places, weights = zip(*unit_nodes(nodes), strict=True)
    # Forward lobes end at the foot, where the rule is split unless the phase function is constant.
    arguments = "height, {}, {}, sigma_t, g"
    whole = "al_panel(foot, " + arguments.format("x0", "x1") + ")"
    split = "    float between = min(max(foot, x0), x1);\n"
    halves = " + ".join(
        f"al_panel(foot, {arguments.format(*ends)})"
        for ends in (("x0", "between"), ("between", "x1"))
    )
    body = f"    return {whole};\n" if phase.constant else f"{split}    return {halves};\n"
    # `quadrature` of `realtime.kernels.stepping`: nodes E' = E cosh u + sqrt(E^2 + 1) sinh u over
    # the width in v = asinh E.
    return f"""{_array("AL_X", places)}
{_array("AL_W", weights)}

float al_panel(float foot, float height, float x0, float x1, float sigma_t, float g) {{
{_interval("1.0")}    float c0 = sqrt(e0 * e0 + 1.0);
    float c1 = sqrt(e1 * e1 + 1.0);
    float width = al_asinh(difference * ((e0 + e1) / (e1 * c0 + e0 * c1)));
    float total = 0.0;
    for (int i = 0; i < {nodes}; i += 1) {{
        float grown = al_exp(width * AL_X[i]);
        float sh = 0.5 * (grown - 1.0 / grown);
        float less = 0.5 * (grown + 1.0 / grown) - 1.0;
        float more = e0 * less + c0 * sh;
        float e = e0 + more;
        float up = 1.0 / (e * e + 1.0);
        float value = (c0 + (e0 * sh + c0 * less)) * up * al_phase(e * e * up, up, g);
        total = total + AL_W[i] * value * al_exp(max(-sigma_t * h * more, -{_number(DEEPEST / LOG2_E)}));
    }}
    return total * width * (2.0 / h) * al_exp(-sigma_t * (x0 + r0));
}}

{_TAKES}float al_integral(float foot, float height, float x0, float x1, float sigma_t, float g) {{
{body}}}
"""


def _ray() -> str:
    parameters = (
        "vec3 origin, vec3 direction, vec3 light, vec3 intensity, float x0, float x1, "
        "float sigma_t, vec3 albedo, float g"
    )
    # The height is the length of a product of vectors: a difference of squares would lose it where
    # the ray passes close to the light. The radiance is albedo sigma_t intensity J/(4 pi).
    return f"""// foot and height [m] of a light over a ray; direction has unit length.
vec2 al_ray(vec3 origin, vec3 direction, vec3 light) {{
    vec3 to = light - origin;
    return vec2(dot(to, direction), length(cross(to, direction)));
}}

// The airlight [W/(m^2 sr)] between x0 and x1 [m] of a ray in the light of a point light of intensity [W/sr].
vec3 al_airlight({parameters}) {{
    vec2 ray = al_ray(origin, direction, light);
    return albedo * intensity * (sigma_t * {_number(0.25 / math.pi)} * al_integral(ray.x, ray.y, x0, x1, sigma_t, g));
}}
"""


def _test(rows: Sequence[Sequence[float]]) -> str:
    lines = []
    # 3e38, a float32, stands for an infinite x1.
    for *arguments, value in rows:
        numbers = ", ".join(_number(min(number, 3e38)) for number in arguments)
        lines.append(
            f"    worst = al_worse(worst, abs(al_integral({numbers}) / {_number(value)} - 1.0));\n"
        )
    # `max` may leave NaN out: a kernel that is NaN on a driver would have no error.
    return f"""// The larger of two errors; NaN counts as 1e30.
float al_worse(float worst, float other) {{
    if (other < 1e30) {{
        return max(worst, other);
    }}
    return 1e30;
}}

// The largest relative error over rays whose integral is known.
float al_test() {{
    float worst = 0.0;
{"".join(lines)}    return worst;
}}
"""
