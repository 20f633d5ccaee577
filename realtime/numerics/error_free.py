# SPDX-License-Identifier: BSD-3-Clause
"""Sums and products that keep what rounding takes from them, so that float32 holds twice its digits where it must.

By the error-free transformations of Knuth (`two_sum`) and Dekker (`two_product`, here by fused multiply-add) a result
is a sum of two numbers, the rounded one and its `low` part. A vector likewise is one of vectors. Errors of the errors,
of second order, are left out: they are as small as rounding in twice the digits.

References
----------
Ogita, Rump, Oishi 2005, *Accurate sum and dot product*, SIAM Journal on Scientific Computing 26.
"""

import drjit as dr


def two_product(a, b):
    """Return the rounded product a b and its rounding error (Dekker)."""
    product = a * b
    return product, dr.fma(a, type(a)(b), -product)


def two_sum(a, b):
    """Return the rounded sum a + b and its rounding error (Knuth)."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


def settled(high, low):
    """Return the same sum of `high` and `low`, its low part below half a unit in the last place of the other (Dekker).

    Valid where `low` is the smaller one; else the low part has the error that rounding makes in it anyway.
    """
    total = high + low
    return total, low - (total - high)


def difference_of_products(a, b, c, d):
    """Return a b - c d with an error of at most 1.5 units in the last place.

    References
    ----------
    Jeannerod, Louvet, Muller 2013, *Further analysis of Kahan's algorithm for the accurate computation of 2x2
    determinants*, Mathematics of Computation 82.
    """
    w = c * d
    error = dr.fma(-c, d, w)
    return dr.fma(a, b, -w) + error


def two_cross(a, b):
    """Return the cross product a x b of two vectors and its rounding error."""
    Vector = type(a)
    forward, forward_error = two_product(Vector(a.y, a.z, a.x), Vector(b.z, b.x, b.y))
    backward, backward_error = two_product(Vector(a.z, a.x, a.y), Vector(b.y, b.z, b.x))
    total, error = two_sum(forward, -backward)
    return total, error + (forward_error - backward_error)


def two_dot(a, b):
    """Return the scalar product a . b of two vectors and its rounding error."""
    products, errors = two_product(a, b)
    partial, partial_error = two_sum(products.x, products.y)
    total, total_error = two_sum(partial, products.z)
    return total, (errors.x + errors.y + errors.z) + (partial_error + total_error)
