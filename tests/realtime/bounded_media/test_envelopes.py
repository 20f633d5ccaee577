# SPDX-License-Identifier: BSD-3-Clause
"""Claim: envelopes of lines that are followed from change to change are those found anew at every place."""

import numpy as np
import pytest

COUNT = 23


def lines_of(rng, kind):
    """Return c, s and whether the least counts, as arrays, in float64."""
    constants, slopes = rng.normal(size=COUNT), rng.normal(size=COUNT)
    if kind == "steep":  # planes along the light
        slopes[rng.random(COUNT) < 0.3] *= 3e5
    elif kind == "tangents":  # of a parabola: every line is part of the envelope
        at = np.linspace(0.05, 5, COUNT)
        constants, slopes = at**2, -2 * at
    elif kind == "through one point":
        constants = 0.7 - 1.3 * slopes
    elif kind == "twice":
        constants[1::2], slopes[1::2] = constants[:-1:2], slopes[:-1:2]
    return constants, slopes, (np.arange(COUNT) > 0) if kind == "tangents" else rng.random(COUNT) < 0.5


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))])
@pytest.mark.parametrize("kind", ["any", "steep", "tangents", "through one point", "twice"])
def test_a_walk_along_a_ray_finds_what_a_search_finds(variant, kind, seed):
    import drjit as dr
    import mitsuba as mi

    from realtime.bounded_media.envelopes import Lines, beyond, envelopes_at, next_change

    Float = mi.Float
    rng = np.random.default_rng(seed)
    constants, slopes, of_least = lines_of(rng, kind)
    columns = Float(constants.astype(np.float32)), Float(slopes.astype(np.float32)), mi.Bool(of_least)
    constants, slopes = (np.asarray(column, dtype=np.float64) for column in columns[:2])

    def line(number):
        return tuple(dr.gather(type(column), column, number) for column in columns)

    def right(place, late, sign):
        """The values at a place of the lines that are least, or largest, within some distance of it."""
        mine = np.flatnonzero(of_least == (sign > 0))
        near = place + np.linspace(-late, late, 41)[:, None]
        chosen = mine[np.argmin(sign * (constants[mine] + slopes[mine] * near), axis=1)]
        return constants[chosen] + slopes[chosen] * place

    def opaque(place):
        return dr.opaque(Float, place)

    x, end, changes = 0.0, 6.0, 0
    lines = Lines(line, COUNT)
    envelopes = envelopes_at(lines, opaque(x))
    while x < end:
        at = float(beyond(opaque(x))[0])
        dr.eval(envelopes)
        change = next_change(lines, envelopes, opaque(at))
        dr.eval(change.next)
        until = min(float(change.next[0]), end)
        assert until >= at * (1 - 1e-7)
        places = np.linspace(at, max(until, at), 5)
        for place, *found in zip(places, *(np.array(value) for value in envelopes.values(Float(places))), strict=True):
            # A change is met some steps of 64 roundings late, more where many lines cross; float32 rounds c + s x.
            late = 64 * 2.0**-24 * (place + 1) * (COUNT if kind == "through one point" else 4)
            rounding = 4 * 2.0**-24 * (np.abs(constants) + np.abs(slopes) * place).max()
            for own, sign in zip(found, (1, -1), strict=True):
                values = right(place, late, sign)
                assert values.min() - rounding <= own <= values.max() + rounding
        envelopes, x, changes = change.envelopes(opaque(until)), max(until, at), changes + 1
        assert changes < 3 * COUNT
    assert changes >= (COUNT // 2 if kind == "tangents" else 1)
