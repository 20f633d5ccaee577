# SPDX-License-Identifier: BSD-3-Clause
"""The layers of an image by order of scattering, and their names: order n is light that was scattered n times."""

from bisect import bisect_right

#: The first order of each layer.
FIRST_ORDERS = (1, 2, 3, 5, 7, 9, 13, 19, 31)
#: The layers; the airlight is their sum.
ORDER_LAYERS = (
    "airlight_1",
    "airlight_2",
    "airlight_3_4",
    "airlight_5_6",
    "airlight_7_8",
    "airlight_9_12",
    "airlight_13_18",
    "airlight_19_30",
    "airlight_31_inf",
)
OPACITY = "opacity"  #: 1 less the transmittance of the clouds up to the surface, or to infinity


def order_layer(order: int) -> str:
    """Return the layer of an `order`, 1 or more."""
    return ORDER_LAYERS[bisect_right(FIRST_ORDERS, order) - 1]
