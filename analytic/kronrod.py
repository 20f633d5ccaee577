# SPDX-License-Identifier: BSD-3-Clause
"""Two Gauss-Kronrod pairs: of 10 and 21 nodes, as in QUADPACK's qk21 (Piessens et al.
1983), and of 3 and 7 nodes.

Every second node of Kronrod, from the second on, is a node of Gauss, so that one evaluation gives
two integrals. The rules of Kronrod with 21 and 7 nodes are exact for polynomials up to degree 31
and 11, the rules of Gauss up to degree 19 and 5.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Pair:
    """A rule of Kronrod, and the rule of Gauss at every second of its nodes."""

    nodes: NDArray[np.float64]  #: of Kronrod, on [-1, 1], in increasing order, (n,)
    weights: NDArray[np.float64]  #: of Kronrod and of Gauss at these nodes, (n, 2)


def _pair(
    half_nodes: tuple, half_kronrod: tuple, middle: float, half_gauss: tuple, gauss_middle: float
) -> Pair:
    """Return a pair from the nodes and weights on one side of the middle, and the weights there.

    Nodes go from the outermost inwards.
    """
    # Gauss has weights at every second node alone, from the second on.
    half = np.zeros(len(half_nodes))
    half[1::2] = half_gauss
    # Both rules are symmetric: the other side has the same weights in reverse.
    kronrod = np.concatenate([half_kronrod, [middle], half_kronrod[::-1]])
    gauss = np.concatenate([half, [gauss_middle], half[::-1]])
    nodes = np.concatenate([-np.array(half_nodes), [0.0], half_nodes[::-1]])
    return Pair(nodes, np.stack([kronrod, gauss], axis=1))


#: 10 and 21 nodes.
WIDE = _pair(
    half_nodes=(
        0.995657163025808080735527280689003,
        0.973906528517171720077964012084452,
        0.930157491355708226001207180059508,
        0.865063366688984510732096688423493,
        0.780817726586416897063717578345042,
        0.679409568299024406234327365114874,
        0.562757134668604683339000099272694,
        0.433395394129247190799265943165784,
        0.294392862701460198131126603103866,
        0.148874338981631210884826001129720,
    ),
    half_kronrod=(
        0.011694638867371874278064396062192,
        0.032558162307964727478818972459390,
        0.054755896574351996031381300244580,
        0.075039674810919952767043140916190,
        0.093125454583697605535065465083366,
        0.109387158802297641899210590325805,
        0.123491976262065851077958109831074,
        0.134709217311473325928054001771707,
        0.142775938577060080797094273138717,
        0.147739104901338491374841515972068,
    ),
    middle=0.149445554002916905664936468389821,
    half_gauss=(
        0.066671344308688137593568809893332,
        0.149451349150580593145776339657697,
        0.219086362515982043995534934228163,
        0.269266719309996355091226921569469,
        0.295524224714752870173892994651338,
    ),
    gauss_middle=0.0,
)
#: 3 and 7 nodes.
NARROW = _pair(
    half_nodes=(
        0.960491268708020283423507092629080,
        0.774596669241483377035853079956480,
        0.434243749346802558002071502844628,
    ),
    half_kronrod=(
        0.104656226026467265193823857192073,
        0.268488089868333440728569280666710,
        0.401397414775962222905051818618432,
    ),
    middle=0.450916538658474142345110087045571,
    half_gauss=(5 / 9,),
    gauss_middle=8 / 9,
)
