# SPDX-License-Identifier: BSD-3-Clause
"""The rows of Billeter, Sintorn, Assarsson 2010: every equation, figure, table and claim that a number can decide.

The paper's method is the mesh; what we made of it, the walk, is asked for only where a row says `ours`.
"""

from functools import partial
from typing import Any

from validation.fidelity.figures import Data, Take, at, impossible, milliseconds, rate, ratio
from validation.fidelity.row import DIFFERS, AtLeast, AtMost, Bound, Equal, Evidence, Figure, NotMeasured, Row
from validation.papers.billeter_tessellation import TABLE

PAPER = "billeter"
TABLES = "airlight published --paper billeter"

_EXACT = AtMost("an identity: what is left is rounding in double precision")
_MACHINE = AtLeast(
    "another machine and scenes of the same kind: asked is whether the published rate is reached", DIFFERS
)
_PASS = AtMost("another machine, without a graphics card: asked is whether the pass takes no longer", DIFFERS)
_ROUNDING = 1e-12
_EQUAL = 1.03  # ratios of rates below this count as equal
VIEWS = {"colonnade": "Sponza", "tangle": "Yeah Right"}


_row = partial(Row, PAPER)


def image(evidence: Evidence, where: str, **wanted: Any) -> Data | None:
    """Return the row of a figure whose entry stands there and has these parameters; None if there is none."""
    for row in evidence["figures"]:
        values = dict(row["entry"]["parameters"])
        method = row["entry"]["method"]
        if row["entry"]["where"] == where and all(
            (method if name == "method" else values.get(name)) == value for name, value in wanted.items()
        ):
            return row
    return None


def _taken(take: Any) -> Any:
    def of_image(where: str, **wanted: Any) -> Take:
        def figure(evidence: Evidence) -> Figure:
            row = image(evidence, where, **wanted)
            if row is None:
                return NotMeasured(f"{where} was not measured")
            if row["light_moved"] is None:
                return NotMeasured(f"not measured: {row['missing']}")
            return take(row)

        return figure

    return of_image


_rate = _taken(lambda row: rate(row["light_moved"]))
_error = _taken(lambda row: float(row["error"]["relative_rmse"]))
_MESH = {"evaluation": "mesh"}
_MARCH = {"method": "ray-march", "sum": "transitions"}


def view(evidence: Evidence, scene: str, texels: int, evaluation: str) -> Data | None:
    """Return a row of Table 1; None if there is none."""
    for row in evidence["table"]:
        if (row["scene"], row["map"], row["evaluation"]) == (scene, texels, evaluation):
            return row
    return None


def _of_view(scene: str, texels: int, evaluation: str, name: str | None = None) -> Take:
    """Return what takes the frames a second of a cell of Table 1, or the milliseconds of a pass."""

    def figure(evidence: Evidence) -> Figure:
        row = view(evidence, scene, texels, evaluation)
        if row is None:
            return NotMeasured(f"{scene} with a map of {texels} was not measured")
        if row["light_moved"] is None:
            return NotMeasured(f"not measured: {row['missing']}")
        if name is None:
            return rate(row["light_moved"])
        return float(row["passes"][name])

    return figure


def _printed_rate(scene: str) -> Take:
    """Return what takes the frames a second that Table 1 prints for the adaptive mesh at the largest map."""
    (rates,) = (table.fps for table in TABLE if table.scene == scene)
    return lambda evidence: float(rates[4096][1])


def _gain(scene: str, texels: int) -> Take:
    return ratio(_of_view(scene, texels, "adaptive"), _of_view(scene, texels, "static"))


def _pays_from(scene: str) -> Take:
    """Return what takes the smallest map from which on the adaptive mesh is faster at every larger one [texels]."""

    def figure(evidence: Evidence) -> Figure:
        smallest_map = 0
        for texels in (4096, 2048, 1024):
            gain = _gain(scene, texels)(evidence)
            if isinstance(gain, NotMeasured):
                return gain
            if (gain if isinstance(gain, (int, float)) else gain.value) <= _EQUAL:
                break
            smallest_map = texels
        return float(smallest_map) if smallest_map else NotMeasured(f"{scene}: at no map is the adaptive mesh faster")

    return figure


_THEORY = (
    _row(
        "eq. 1",
        "the airlight of a line segment is an integral over the distance",
        Bound(_ROUNDING),
        "equations",
        at("distance"),
        _EXACT,
    ),
    _row("eq. 2", "L(d0, d1) = L(0, d1) - L(0, d0)", Bound(_ROUNDING), "equations", at("segments"), _EXACT),
    _row(
        "eq. 3",
        "the airlight is a signed sum over the boundaries",
        Bound(_ROUNDING),
        "equations",
        at("segments"),
        _EXACT,
    ),
    _row(
        "3, order",
        "the order in which the boundaries are processed does not matter",
        Bound(_ROUNDING),
        "equations",
        at("order"),
        _EXACT,
    ),
    _row(
        "Fig. 2",
        "a ray with one dark region is a sum of two lit ones",
        Bound(_ROUNDING),
        "equations",
        at("two_lit"),
        _EXACT,
    ),
    _row(
        "Fig. 3a",
        "two distinct dark regions: signed terms give the airlight",
        Bound(_ROUNDING),
        "equations",
        at("segments"),
        _EXACT,
    ),
    _row(
        "Fig. 3b",
        "overlapping regions remove too much airlight: share that is lost",
        Bound(0),
        "equations",
        lambda evidence: -evidence["overlap"],
        AtMost("the loss is counted negative; any loss confirms the claim"),
    ),
    _row(
        "2, Sun et al.",
        "a form of the integral depends on dimensionless parameters only: times h",
        Bound(_ROUNDING),
        "equations",
        at("scaling"),
        _EXACT,
    ),
    _row(
        "1, optically thin",
        "for optically thin media single scattering is a very good approximation: share that scatters more than once",
        Bound(0.05),
        "thin media",
        at("thin"),
        AtMost("very good is read as 5 %; `open-fog` with an optical depth of 0.01 to the lamp"),
    ),
    _row(
        "3, shadow volumes",
        "planes can intersect, so that sorting them by polygon is not accurate: RMSE so sorted over RMSE per pixel",
        Bound(10),
        "orders",
        ratio(at("hall", "paper", "relative_rmse"), at("hall", "exact", "relative_rmse")),
        AtLeast("in `hall`, by the order of Biri 2006"),
    ),
)

_MESHES = (
    _row(
        "4, no overlap",
        "the volume has no nesting or overlapping: edges of triangles without exactly one neighbour",
        Bound(0),
        "tessellation",
        at("open_edges"),
        Equal(0, "a closed mesh, counted in the colonnade"),
    ),
    _row(
        "4, triangles",
        "a map of 1024 x 1024 gives more than two million triangles",
        2e6,
        "tessellation",
        at("triangles_1024"),
        AtLeast("two for each texel, and those at the border"),
    ),
    _row(
        "Fig. 8, triangles",
        "a map of 4096 x 4096 would yield over 32 million triangles",
        32e6,
        "tessellation",
        at("triangles_4096"),
        AtLeast("two for each texel, and those at the border"),
    ),
    _row(
        "4.1, neighbours",
        "tessellation levels of connected quads differ by at most one",
        1,
        "tessellation",
        at("level_steps"),
        AtMost("the largest difference in the colonnade, six faces"),
    ),
    _row(
        "4.1, T-junctions",
        "T-junctions are avoided",
        Bound(0),
        "tessellation",
        at("open_edges"),
        Equal(0, "a closed mesh has none"),
    ),
    _row(
        "4.1, configurations",
        "there are 16 distinct configurations",
        16,
        "tessellation",
        at("configurations"),
        Equal(0, "those that occur in the colonnade"),
    ),
    _row(
        "4.1, six triangles",
        "at most six triangles are emitted for a quad",
        6,
        "tessellation",
        at("most_triangles"),
        Equal(0, "of the configurations that occur"),
    ),
    _row(
        "Fig. 8b",
        "flat surfaces use a low level, edges are tessellated much more: side of the quads there over that at edges",
        Bound(2),
        "tessellation",
        ratio(at("flat"), at("jump")),
        AtLeast("much more is read as twice; medians over the texels of the colonnade"),
        unit="times",
    ),
    _row(
        "4.1, Laplacian",
        "a Laplacian filter finds the edges: error of the airlight with it over ours, with as many triangles",
        Bound(1.1),
        "tessellation",
        ratio(at("filters", "plain", "error"), at("filters", "ours", "error")),
        AtMost("finds is read as 10 % at most above a filter that bounds the error at every level"),
        unit="times",
    ),
    _row(
        "4.1, Laplacian, depth",
        "the same of the depth of the mesh, root mean square",
        Bound(1.1),
        "tessellation",
        ratio(at("filters", "plain", "rms_departure"), at("filters", "ours", "rms_departure")),
        AtMost("finds is read as 10 % at most above a filter that bounds the error at every level"),
        unit="times",
    ),
    _row(
        "Fig. 5, acne",
        "with depth testing and no bias there are artefacts: relative RMSE to the clamped sum",
        Bound(0.1),
        "tessellation",
        lambda evidence: evidence["biased"][0]["error"],
        AtLeast("an artefact is read as 10 % of the airlight, in `omni-box`"),
    ),
    _row(
        "5, biased extrusion",
        "a bias would work in many simple cases: relative RMSE to the clamped sum, at the best of five",
        Bound(0.01),
        "tessellation",
        lambda evidence: min(error["error"] for error in evidence["biased"]),
        AtMost("works is read as 1 %; `omni-box` is a simple case"),
    ),
    _row(
        "5, insufficient biasing",
        "insufficient biasing leads to very unpleasant artefacts: relative RMSE at 1e-5 of the depth",
        Bound(0.1),
        "tessellation",
        lambda evidence: evidence["biased"][1]["error"],
        AtLeast("an artefact is read as 10 % of the airlight, in `omni-box`"),
    ),
)

_PICTURES = (
    _row(
        "Fig. 1",
        "two lights cast volumetric shadows from maps of 1024 x 1024: relative RMSE of the mesh, in a hall of our own",
        Bound(0.01),
        "two lights",
        at("mesh"),
        AtMost("the cathedral of Sibenik is not ours to ship; 1 % against the truth"),
    ),
    _row(
        "Fig. 6a",
        "aliasing is clearly observed with a map of 32: relative RMSE",
        Bound(0.02),
        "maps",
        at("errors", "32"),
        AtLeast("clearly is read as 2 %"),
    ),
    _row(
        "Fig. 6b",
        "the airlight is already very smooth with a map of 128: relative RMSE",
        Bound(0.02),
        "maps",
        at("errors", "128"),
        AtMost("as the row above, the other way round"),
    ),
    _row(
        "Fig. 6c",
        "mostly indistinguishable from (b): relative RMSE of one image to the other",
        Bound(0.01),
        "maps",
        at("between"),
        AtMost("indistinguishable is read as 1 %"),
    ),
    _row(
        "6, Wyman and Ramsey",
        "the first and last shadow planes span the entire depth: mean share of a ray between them",
        Bound(0.9),
        "shadows",
        at("span"),
        AtLeast("in `colonnade`, another hall: entire is read as 90 %", DIFFERS),
    ),
    _row(
        "6, triangles",
        "performance is largely independent of the number of triangles: time of the volume, 524 290 over 514",
        Bound(1.5),
        "triangles",
        lambda evidence: _of_triangles(evidence, "volume"),
        AtMost("a thousand times as many triangles: largely is read as half as much again"),
        unit="times",
    ),
    _row(
        "6, triangles, whole frame",
        "other than the rendering of view and map: time of the whole frame, 524 290 over 514",
        Bound(1.5),
        "triangles",
        lambda evidence: _of_triangles(evidence, "frame"),
        AtMost("as the row above, with the view and the map", DIFFERS),
        unit="times",
    ),
    _row(
        "3, shadow planes",
        "shadow volumes come from the geometry: time of a frame of shadow planes, 524 290 triangles over 514",
        Bound(1.5),
        "triangles",
        lambda evidence: _of_triangles(evidence, "planes"),
        AtLeast("a method whose time depends on the geometry needs more than half as much again"),
        unit="times",
    ),
    _row(
        "4, directional lights",
        "for a directional light the borders are connected to the position of the light",
        None,
        "nothing",
        impossible("a directional light has no position: a spot is meant, whose mesh is closed, see `4, no overlap`"),
        None,
    ),
    _row(
        "7, textured lights",
        "textured light sources might be more problematic",
        None,
        "nothing",
        impossible(
            "no method here takes a textured light: the scene reader refuses it by name, so nothing is measured"
        ),
        None,
    ),
)


def _of_triangles(evidence: Evidence, name: str) -> Figure:
    few, many = evidence["rows"][0][name], evidence["rows"][-1][name]
    return ratio(lambda _: milliseconds(many), lambda _: milliseconds(few))(evidence)


_FIGURES = (
    *(
        _row(
            f"Fig. 6{letter}, FPS",
            f"frames a second with a map of {texels}",
            fps,
            "billeter tables",
            _rate(f"Fig. 6{letter}", **_MESH),
            _MACHINE,
            unit="frames/s",
            command=TABLES,
        )
        for letter, texels, fps in (("a", 32, 230), ("b", 128, 165), ("c", 512, 25))
    ),
    _row(
        "6, map size",
        "frame rates depend mostly on the resolution of the map: time at 512 over that at 32, the mesh",
        230 / 25,
        "billeter tables",
        ratio(_rate("Fig. 6a", **_MESH), _rate("Fig. 6c", **_MESH)),
        Equal(0.25, "the published ratio within a quarter", DIFFERS),
        unit="times",
        command=TABLES,
    ),
    _row(
        "Fig. 7a, FPS",
        "marching, 150 samples",
        25,
        "billeter tables",
        _rate("Fig. 7a", **_MARCH),
        _MACHINE,
        unit="frames/s",
        command=TABLES,
    ),
    _row(
        "Fig. 7b, FPS",
        "marching, 400 samples",
        10,
        "billeter tables",
        _rate("Fig. 7b", **_MARCH),
        _MACHINE,
        unit="frames/s",
        command=TABLES,
    ),
    _row(
        "Fig. 7c, FPS",
        "light volume",
        96,
        "billeter tables",
        _rate("Fig. 7c", **_MESH),
        _MACHINE,
        unit="frames/s",
        command=TABLES,
    ),
    *(
        _row(
            f"Fig. 7, against {steps} samples{', ours' if form else ''}",
            f"times as fast as marching with {steps} samples{', the walk in place of the mesh' if form else ''}",
            96 / fps,
            "billeter tables",
            ratio(_rate("Fig. 7c", **(form or _MESH)), _rate(where, **_MARCH)),
            AtLeast("the ratio of two methods on one machine", DIFFERS),
            unit="times",
            command=TABLES,
        )
        for steps, fps, where in ((150, 25, "Fig. 7a"), (400, 10, "Fig. 7b"))
        for form in (None, {"evaluation": "walk", "walls": "slanted"})
    ),
    _row(
        "Fig. 7, equal quality",
        "about 400 samples give equal quality: error of marching over that of the light volume, against the truth",
        Bound(1.1),
        "billeter tables",
        ratio(_error("Fig. 7b", **_MARCH), _error("Fig. 7c", **_MESH)),
        AtMost("equal is read as 10 %"),
        unit="times",
        command=TABLES,
    ),
    _row(
        "6, Engelhardt and Dachsbacher",
        "generally faster for equal quality: frames a second of the mesh over epipolar sampling",
        Bound(1),
        "billeter tables",
        ratio(_rate("Fig. 7c", **_MESH), _rate("peer", method="min-max")),
        AtLeast("the ratio of two methods on one machine, by their errors of equal quality", DIFFERS),
        unit="times",
        command=TABLES,
    ),
)

_TABLE = (
    *(
        _row(
            f"Table 1, {VIEWS[table.scene]}, {texels}, {evaluation}, FPS",
            "frames a second",
            fps,
            "billeter tables",
            _of_view(table.scene, texels, evaluation),
            _MACHINE,
            unit="frames/s",
            command=TABLES,
        )
        for table in TABLE
        for texels, rates in table.fps.items()
        for evaluation, fps in zip(("static", "adaptive"), rates)
    ),
    *(
        _row(
            f"Table 1, {VIEWS[table.scene]}, {texels}, {evaluation}, {name}",
            f"time of the pass `{name}`",
            value,
            "billeter tables",
            _of_view(table.scene, texels, evaluation, name),
            _PASS,
            unit="ms",
            command=TABLES,
        )
        for table in TABLE
        for (texels, evaluation), passes in table.passes.items()
        for name, value in passes.items()
    ),
    *(
        _row(
            f"6, adaptive tessellation, {view_name}",
            "benefits are first observed for large maps: the smallest map from which on the adaptive mesh is faster",
            4096,
            "billeter tables",
            _pays_from(scene),
            Equal(0, "of the maps of Table 1; rates within 3 % count as equal", DIFFERS),
            unit="texels",
            command=TABLES,
        )
        for scene, view_name in VIEWS.items()
    ),
    *(
        _row(
            f"Fig. 8{letter}, FPS",
            "the caption has the frames a second of Table 1",
            fps,
            "nothing",
            _printed_rate(scene),
            Equal(0, "the paper's own table"),
            unit="frames/s",
        )
        for letter, scene, fps in (("a", "colonnade", 18), ("c", "tangle", 12))
    ),
    _row(
        "6, irregular geometry",
        "adaptive tessellation is less beneficial for irregular geometry: its gain at 4096, Yeah Right over Sponza",
        Bound(1),
        "billeter tables",
        ratio(_gain("tangle", 4096), _gain("colonnade", 4096)),
        AtMost("both gains on one machine; published 1.5 over 1.8"),
        unit="times",
        command=TABLES,
    ),
)

ROWS: tuple[Row, ...] = (*_THEORY, *_MESHES, *_PICTURES, *_FIGURES, *_TABLE)
