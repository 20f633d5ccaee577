# SPDX-License-Identifier: BSD-3-Clause
"""Light along straight lines through a slab: exact exponentials, with the source a
polynomial on each panel of depth.

Along a direction of cosine mu, the radiance I obeys, z the optical depth from the top,

    -mu dI/dz = -I + Q      (mu > 0 upwards),

so that over a panel of depth h, with s the depth from the side where light enters,

    I(s) = I(0) exp(-s/|mu|) + int_0^s exp(-(s - s')/|mu|) Q(s') ds'/|mu|.

Q is the polynomial through its values at the Gauss-Legendre nodes of the panel. With y = (s -
s')/|mu| the integral is int_0^Y exp(-y) Q(s - |mu| y) dy, Y = s/|mu|: Gauss-Legendre over y up to
60, where exp(-y) is below rounding.

Panels are narrow at both boundaries, where radiance changes over the smallest cosine, and grow with
the distance from them (the source of isotropic light has a term z log z there).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DepthPanels:
    """A grid of depth: panels with Gauss-Legendre nodes."""

    edges: Array  #: (P + 1,), increasing from 0 to the thickness of the slab [mean free paths]
    nodes: Array  #: (P, K), depths of the nodes

    @property
    def depths(self) -> Array:
        """All nodes in one row, (P K,)."""
        return self.nodes.reshape(-1)


def depth_panels(
    tau: float,
    narrowest: float,
    *,
    depths: Sequence[float] = (),
    count: int = 8,
    widest: float = 1.25,
) -> DepthPanels:
    """Return panels for a slab.

    `tau`: thickness [mean free paths]; `narrowest`: width of the panels at both boundaries, where
    the slab is thicker than that; `depths`: depths in [0, tau] that become edges, so that results
    are known there; `count`: nodes of each panel; `widest`: width of a panel at most, where the
    distance from the boundaries is not over 50 [mean free paths].
    """
    # From the boundary inwards panels are as wide as `growth` times their distance from it, but at
    # least `narrowest` and at most `widest`; far inside that limit grows, too.
    growth, deep, deep_growth = 0.7, 50.0, 0.03
    half = [0.0]
    while half[-1] < tau / 2:
        limit = max(widest, deep_growth * (half[-1] - deep))
        half.append(half[-1] + min(max(narrowest, growth * half[-1]), limit))
    # The last edge lies beyond the middle: all are drawn in, so that it meets its mirror image.
    upper = np.array(half) * (tau / 2 / half[-1])
    edges = np.unique(
        np.concatenate([upper, tau - upper, np.asarray(depths, dtype=np.float64), [0.0, tau]])
    )
    # Where rounding puts two edges side by side, the one that is not a requested depth is left out:
    # callers look their depths up among the edges.
    distinct = [0.0]
    requested = {0.0, float(tau), *map(float, depths)}
    for edge in edges[1:]:
        if edge - distinct[-1] > 1e-12 * tau:
            distinct.append(float(edge))
        elif float(edge) in requested:
            distinct[-1] = float(edge)
    edges = np.array(distinct)
    edges[0], edges[-1] = 0.0, tau
    nodes, _ = leggauss(count)
    return DepthPanels(
        edges=edges, nodes=edges[:-1, None] + np.diff(edges)[:, None] * (nodes + 1) / 2
    )


class Transport:
    """Light from sources to all depths of a slab along some directions, in arrays whose
    numbers are of type `number`.

    `panels`: the grid; `mu`: (J,) cosines, positive upwards, none of them 0. No
    light enters from outside.
    """

    def __init__(self, panels: DepthPanels, mu: Array, number: type = np.float64):
        self.panels = panels
        # Directions by side, upward ones first, and the way back to the order of the caller.
        self._order = np.concatenate([np.flatnonzero(mu > 0), np.flatnonzero(mu < 0)])
        self._back = np.argsort(self._order)
        above = int((mu > 0).sum())
        self._sides: list[tuple[int, slice, Array]] = []
        for sign, side in ((1, slice(0, above)), (-1, slice(above, mu.size))):
            if side.start == side.stop:
                continue
            cosines = np.abs(mu[self._order[side]])
            # Upward light meets the panels from the bottom, so that their widths come in reverse.
            weights, fade = panel_weights(
                np.diff(panels.edges)[::-sign], cosines, panels.nodes.shape[1]
            )
            # From sources at the K nodes and light that enters, in the last column, to the K nodes
            # and the far edge, in the last row: (P, J, K + 1, K + 1).
            weights_and_fade = np.moveaxis(
                np.concatenate([weights, fade[:, :, None]], axis=2), 3, 1
            )
            self._sides.append((sign, side, np.ascontiguousarray(weights_and_fade.astype(number))))

    def __call__(self, source: Array) -> tuple[Array, Array]:
        """Return the radiance of a source, at nodes and edges.

        `source`: (F, Z, J): F fields at the Z = P K nodes. Returns `nodes`, `edges`: (F,
        Z, J) and (F, P + 1, J).
        """
        fields, depths, directions = source.shape
        shape = *self.panels.nodes.shape, directions, fields
        # (F, Z, J) to (P, K, J, F): panels first, as `sweep` goes from one to the next, and fields
        # last, as the columns of its products.
        ordered = np.ascontiguousarray(source[..., self._order].transpose(1, 2, 0)).reshape(shape)
        radiance, edges = self.sweep(ordered, range(len(self.panels.edges)), inside=True)
        nodes = radiance.reshape(depths, directions, fields)
        return nodes.transpose(2, 0, 1)[..., self._back], edges.transpose(2, 0, 1)[..., self._back]

    def sweep(self, source: Array, places: Sequence[int], *, inside: bool) -> tuple[Array, Array]:
        """Return the radiance of a source (P, K, J, F) at its nodes, and at edges, (D, J, F).

        Upward directions come first, then the others. `places`: numbers of the edges, (D,);
        `inside`: whether radiance at the nodes is needed.
        """
        panels, nodes, directions, count = source.shape
        radiance = np.empty_like(source) if inside else source[:0]
        at_edges = np.zeros((len(places), directions, count), source.dtype)
        # All directions of a side march from panel to panel, from the boundary where no light
        # enters.
        for sign, side, weights in self._sides:
            # The input of a panel: its sources at K nodes, and in the last row the light that
            # enters, 0 at the first panel.
            inputs = np.zeros((side.stop - side.start, nodes + 1, count), source.dtype)
            outputs = np.empty_like(inputs)
            for step in range(panels):
                panel = panels - 1 - step if sign > 0 else step
                # Upward light runs through the nodes backwards; the nodes of a panel are symmetric.
                inputs[:, :nodes] = source[panel, ::-sign, side].transpose(1, 0, 2)
                np.matmul(weights[step], inputs, out=outputs)
                if inside:
                    radiance[panel, ::-sign, side] = outputs[:, :nodes].transpose(1, 0, 2)
                # The light at the far edge enters the next panel.
                inputs[:, nodes] = outputs[:, nodes]
                # The far edge of a panel is its upper one for upward light.
                edge = panel if sign > 0 else panel + 1
                for number, at in enumerate(places):
                    if at == edge:
                        at_edges[number, side] = inputs[:, nodes]
        return radiance, at_edges


def panel_weights(all_widths: Array, mu: Array, count: int) -> tuple[Array, Array]:
    """Return (P, K + 1, K, J) weights of the source, and (P, K + 1, J) exponentials, at
    the nodes and the far edge.
    """
    # exp(-60) is below the rounding of 1.
    negligible, convolution_nodes = 60.0, 48
    # Panels of one width share their weights: W different widths.
    widths, index = np.unique(all_widths, return_inverse=True)
    reference, _ = leggauss(count)
    places = np.append((reference + 1) / 2, 1.0)
    y01, y_weights = leggauss(convolution_nodes)
    # Y = s/|mu| at the nodes and the far edge, (W, J, K + 1); the integral over y ends there.
    reach = widths[:, None, None] * places / mu[:, None]
    longest = np.minimum(reach, negligible)
    y = longest[..., None] * (y01 + 1) / 2
    s = places[:, None] - y * (mu[:, None, None] / widths[:, None, None, None])  # in panel widths
    kernel = np.exp(-y) * y_weights * (longest[..., None] / 2)
    # From values at the nodes to coefficients of Legendre polynomials.
    inverse = np.linalg.inv(np.polynomial.legendre.legvander(reference, count - 1))
    # int exp(-y) P_l(2 s - 1) dy, then from coefficients to values at the nodes
    basis = np.polynomial.legendre.legvander(2 * s - 1, count - 1)
    by_degree = np.einsum("wjkq,wjkql->wkjl", kernel, basis)
    weights = np.moveaxis(by_degree @ inverse, 3, 2)
    fade = np.moveaxis(np.exp(-reach), 2, 1)
    return np.ascontiguousarray(weights[index]), np.ascontiguousarray(fade[index])
