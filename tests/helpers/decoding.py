# SPDX-License-Identifier: BSD-3-Clause
"""The decoder of the page's images in Python: what `reports/page/templates/codec.js` does in the browser."""

import zlib

import numpy as np
from numpy.typing import NDArray

from reports.page.image_codec import DIFFERENCE_BITS, GRADIENT, INFINITE, LEFT, NAN, Array, Codes, Packed


def difference_values(codes: Codes, k: float, s: float) -> Array:
    """Return the relative differences that the codes of `difference_codes` stand for, in the same shape."""
    values = s * np.sinh(codes / k)
    values = np.where(codes == INFINITE, np.inf, np.where(codes == -INFINITE, -np.inf, values))
    return np.where(codes == NAN, np.nan, values)


def decode_planes(packed: Packed, size: tuple[int, int], bits: int) -> Codes:
    """Return the codes, (height, width, planes); those of 16 bits with their sign."""
    width, height = size
    raw = np.frombuffer(zlib.decompress(packed.data), np.uint8).astype(np.int64)
    decoded: list[NDArray[np.int64]] = []
    for part, (relative, predictor) in zip(np.split(raw, len(packed.planes)), packed.planes):
        zigzag = sum(byte << 8 * place for place, byte in enumerate(np.split(part, bits // 8)))
        residual = np.where(zigzag & 1, -(zigzag + 1) // 2, zigzag // 2).reshape(height, width)
        if predictor == LEFT:
            residual = np.cumsum(residual, axis=1)
        elif predictor == GRADIENT:
            residual = np.cumsum(np.cumsum(residual, axis=1), axis=0)
        codes = residual + decoded[0] if relative else residual
        decoded.append(np.asarray(codes % (1 << bits), dtype=np.int64))
    planes = np.stack(decoded, axis=-1)
    if bits == DIFFERENCE_BITS:
        planes = np.where(planes >> (bits - 1), planes - (1 << bits), planes)
    return planes.astype(np.int32)
