# SPDX-License-Identifier: BSD-3-Clause
"""The filters of images again, in NumPy, tap by tap as their definitions stand."""

import numpy as np


def slow_bilateral(image, *, hd, guides=(), support=3.0):
    """Return an image (height, width) filtered; guides are pairs of an image (height, width[, n]) and its width."""
    height, width = image.shape
    reach = int(np.ceil(support * hd))
    filtered = np.empty_like(image, dtype=np.float64)
    for row in range(height):
        for column in range(width):
            total = weighed = 0.0
            for r in range(max(row - reach, 0), min(row + reach, height - 1) + 1):
                for c in range(max(column - reach, 0), min(column + reach, width - 1) + 1):
                    exponent = ((r - row) ** 2 + (c - column) ** 2) / hd**2
                    exponent += sum(np.sum((g[r, c] - g[row, column]) ** 2) / w**2 for g, w in guides)
                    share = np.exp(-0.5 * exponent)
                    total, weighed = total + share, weighed + share * image[r, c]
            filtered[row, column] = weighed / total
    return filtered


def slow_tile_average(image, *, guides=()):
    """Return the mean over 5 x 5 pixels, those at the ends with half a weight, weighted by guides."""
    shares = np.outer([0.5, 1, 1, 1, 0.5], [0.5, 1, 1, 1, 0.5])
    height, width = image.shape
    averaged = np.empty_like(image, dtype=np.float64)
    for row in range(height):
        for column in range(width):
            total = weighed = 0.0
            for (down, right), share in np.ndenumerate(shares):
                r, c = row + down - 2, column + right - 2
                if 0 <= r < height and 0 <= c < width:
                    share *= np.exp(-0.5 * sum(np.sum((g[r, c] - g[row, column]) ** 2) / w**2 for g, w in guides))
                    total, weighed = total + share, weighed + share * image[r, c]
            averaged[row, column] = weighed / total
    return averaged
