# SPDX-License-Identifier: BSD-3-Clause
"""A device that is as wrong as Vulkan permits: exported GLSL run as Python, on numbers
whose every operation errs.

Vulkan 1.3, "Precision and Operation of SPIR-V Instructions": sums and products are rounded to one
of the two nearest float32, by any rule; a quotient may be off by 2.5 ulp, `sqrt` by what
1/inversesqrt may be, 2 + 2.5 ulp; numbers below 2^-126 may become 0. A device of one sign errs by
all of that in one direction, one of chance in either.
"""

import ctypes
import math
import re

_FLOAT = r"(?<![\w.])\d+(?:\.\d*(?:e[-+]?\d+)?|e[-+]?\d+)"


def on_loose_device(text, signs):
    """Return the function `al_integral` of exported GLSL on a device whose next error
    has the next of `signs`.
    """
    names = {"Loose": _loose(signs), "abs": abs, "min": min, "max": max, "int": int}
    names |= {"floor": lambda x: type(x)(math.floor(x)), "ceil": lambda x: type(x)(math.ceil(x))}
    names |= {"sqrt": lambda x: type(x).off(math.sqrt(x), 4.5), "floatBitsToInt": _bits}
    names |= {
        "intBitsToFloat": lambda n: names["Loose"](
            ctypes.c_float.from_buffer(ctypes.c_int32(n)).value
        )
    }
    exec(_python(text), names)
    function, number = names["al_integral"], names["Loose"]
    return lambda *ray: float(function(*(number(value) for value in ray)))


def _bits(x):
    return ctypes.c_int32.from_buffer(ctypes.c_float(x)).value


def _loose(signs):
    class Loose(float):
        """A float32; what is computed with it errs."""

        def __new__(cls, value):
            rounded = ctypes.c_float(value).value
            return super().__new__(cls, rounded if abs(rounded) >= 2.0**-126 else 0.0)

        @classmethod
        def off(cls, value, ulps):
            return cls(value * (1 + next(signs) * ulps * 2.0**-23))

        @classmethod
        def rounded(cls, value):
            near = ctypes.c_float(value).value
            error = value - near
            if error and (error > 0) == (next(signs) > 0):
                near = ctypes.c_float(
                    near + math.copysign(2.0**-23 * 0.75 * abs(near), error)
                ).value
            return cls(near)

        def __neg__(self):
            return type(self)(-float(self))

        def __abs__(self):
            return type(self)(math.fabs(self))

        def __add__(self, other):
            return self.rounded(float(self) + float(other))

        def __sub__(self, other):
            return self.rounded(float(self) - float(other))

        def __mul__(self, other):
            return self.rounded(float(self) * float(other))

        def __truediv__(self, other):
            return self.off(float(self) / float(other), 2.5)

    return Loose


def _python(text):
    """Return the functions before `al_ray` as Python: the template is a subset of C
    with one statement a line.
    """
    text = text[: text.index("// foot and height")]
    text = re.sub(r"^#.*\n|//.*", "", text, flags=re.M).replace("AL_PRECISE ", "")
    text = re.sub(r"^const float (\w+)\[\d+\] = float\[\d+\]", r"\1 = ", text, flags=re.M)
    text = re.sub(r"^( *)float (\w+)\[(\d+)\];", r"\1\2 = [None] * \3", text, flags=re.M)
    text = re.sub(r"\bfloat\(", "Loose(", re.sub(_FLOAT, r"Loose(\g<0>)", text))
    text = re.sub(
        r"^float (\w+\(.*\)) {", lambda m: f"def {m[1].replace('float ', '')}:", text, flags=re.M
    )
    text = re.sub(r"for \(int (\w) = 0; \w < (\w+); .*\) {", r"for \1 in range(\2):", text)
    text = re.sub(r"\b(if \(.*\)) {", r"\1:", text)
    text = re.sub(
        r"^( +)int (.*)", lambda m: f"{m[1]}{m[2].replace(' / ', ' // ')}", text, flags=re.M
    )
    return re.sub(
        r"^( *)float ", r"\1", re.sub(r"^ *}\n", "", text.replace(";", ""), flags=re.M), flags=re.M
    )
