# SPDX-License-Identifier: BSD-3-Clause
r"""Images as integers that compress well, for a page that decodes them in the browser.

A page holds hundreds of images. Readers look at the errors, which must not drown in the rounding of the encoding: a
half float moves a radiance by up to 5e-4, a good method by 1e-6. Therefore only the reference is stored as radiance;
every other image is stored as its difference from the reference, relative as in `validation.metrics.errors`:

    d = (test - reference) / max(|reference|, floor),        floor = 0.001 mean(reference)
    code = round(k asinh(d / s)),       k = 250, s = 1e-4     16 bits

which is linear for |d| < s and logarithmic above, so that the rounding of d is at most

    (1/2k) sqrt(s^2 + d^2)  (+ terms of second order in 1/k)

that is 0.2 % of a large error, and 2e-7 of the reference for a small one. The largest code stands for d = 1e52, which
float32 does not reach. The reference keeps the upper 24 bits of each float32, rounded: 16 binary digits, to
2^-16 = 1.5e-5 relative at most. `d` is taken against the rounded reference in the denominator and against the exact one
in the difference, so that the errors do not see that rounding.

A code is then predicted from the left, in the second and third channel from the first too; what remains, zigzag coded
(0, -1, 1, -2, ...), goes byte by byte, low bytes first, into zlib. All arithmetic is modulo 2^bits, so decoding is
exact. `templates/codec.js` is the decoder of the page.
"""

import zlib

import numpy as np
from numpy.typing import NDArray

Codes = NDArray[np.int32]
Array = NDArray[np.float64]

REFERENCE_BITS, DIFFERENCE_BITS, FLIP_BITS = 24, 16, 8
LARGEST = 32766  #: code of the largest finite difference
NAN, INFINITE = -32768, 32767  #: codes of values that are not finite; minus infinity is -INFINITE


K, S = 250.0, 1e-4  #: codes for each factor e of a large difference, and where the scale turns from linear


def reference_codes(radiance: NDArray[np.floating]) -> Codes:
    """Return the upper 24 bits of float32 values of any shape, rounded to nearest; every NaN has the same code."""
    with np.errstate(over="ignore"):  # values beyond float32 become infinite, as in the file
        single = np.ascontiguousarray(radiance, dtype=np.float32)
    bits = single.view(np.uint32).astype(np.int64)
    # Rounding up the largest finite numbers may reach the pattern of infinity, never beyond.
    rounded = (bits + 0x80) >> 8
    codes = np.where(np.isfinite(single), rounded, bits >> 8)
    return np.where(np.isnan(single), 0x7FC000, codes).astype(np.int32)


def reference_values(codes: Codes) -> Array:
    """Return the values that the codes of `reference_codes` stand for, in the same shape."""
    return (codes.astype(np.uint32) << np.uint32(8)).view(np.float32).astype(np.float64)


def difference_codes(difference: Array) -> Codes:
    """Return the codes of relative differences, in the same shape."""
    with np.errstate(invalid="ignore"):
        codes = np.round(K * np.arcsinh(difference / S))
    codes = np.where(np.abs(codes) > LARGEST, np.copysign(INFINITE, codes), codes)
    return np.where(np.isnan(difference), NAN, codes).astype(np.int32)


def pack_planes(codes: Codes, bits: int) -> bytes:
    """Compress planes of codes, (height, width, planes), taken modulo 2^bits; bits are 8, 16 or 24."""
    parts: list[bytes] = []
    for number in range(codes.shape[-1]):
        plane = codes[..., number].astype(np.int32) - (codes[..., 0] if number else 0)
        rest = np.diff(plane, axis=1, prepend=np.int32(0)) << (32 - bits)
        signed = rest >> (32 - bits)  # modulo 2^bits, with its sign
        zigzag = ((signed << 1) ^ (signed >> 31)) & ((1 << bits) - 1)
        parts += [(zigzag >> shift).astype(np.uint8).tobytes() for shift in range(0, bits, 8)]
    return zlib.compress(b"".join(parts), 6)
