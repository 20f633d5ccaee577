# SPDX-License-Identifier: BSD-3-Clause
"""Claim: each relation fails for the fault that it is made for, and for no other.

A renderer of forty lines of NumPy has a lamp, a spot or a grey light all round in homogeneous fog,
a wall behind it, and a fault by name. It shares no code with anything that it is judged by.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.validation.check.check_file import Asked, Camera, read_check
from airlight.validation.check.judge import FAILS, HOLDS, UNKNOWN, Kept, judge, signature
from airlight.validation.check.relations import RELATIONS

SIZE, FOV, STEPS = (48, 36), 60.0, 192
LAMP, STRENGTH = np.array([0.4, 3.0, 0.7]), np.array([8.0, 5.0, 3.0])
SIGMA, ALBEDO, WALL = 0.12, np.array([0.9, 0.7, 0.5]), 7.0


def axes(turn):
    """Return right, down and forward of a camera that is turned to the right [rad]."""
    c, s = math.cos(turn), math.sin(turn)
    return np.array([c, -s, 0]), np.array([0.0, 0, -1]), np.array([s, c, 0])


def rays(size, turn):
    right, down, forward = axes(turn)
    half = math.tan(math.radians(FOV) / 2)
    x = half * ((np.arange(size[0]) + 0.5) * 2 / size[0] - 1)
    y = half * ((np.arange(size[1]) + 0.5) * 2 / size[0] - size[1] / size[0])
    ways = x[None, :, None] * right + y[:, None, None] * down + forward
    return ways / np.linalg.norm(ways, axis=2, keepdims=True), forward


def render(
    fault="",
    *,
    size=SIZE,
    turn=0.0,
    place=(0, 0, 0),
    lamps=((LAMP, STRENGTH),),
    sigma=SIGMA,
    albedo=ALBEDO,
    scale=1.0,
    exposure=1.0,
    ambient=0.0,
    box=9.0,
    walled=True,
    seed=0,
):
    """Return airlight, surface and their sum; `scale`: of all lengths; `box`: how far fog reaches."""
    direction, forward = rays(size, turn)
    sigma, far = sigma / scale, WALL * scale
    depth_of = direction @ forward
    # A wall all round, at one distance, so that it looks alike from all directions.
    distance = np.full(direction.shape[:2], far)
    attenuation = sigma * (depth_of if fault == "planar depth" else 1.0)
    dt = distance / STEPS
    airlight = np.zeros((*direction.shape[:2], 3))
    for step in range(STEPS):
        t = (step + 0.5) * dt
        point = t[..., None] * direction + place
        arriving = np.zeros_like(airlight)
        for lamp, strength in lamps:
            r = np.linalg.norm(point - np.asarray(lamp) * scale - place, axis=2)
            law = 1 / (r * r + (1.0 if fault == "softened law" else 0.0))
            path = box * scale if fault == "constant light path" else r
            lit = np.exp(-sigma * (0.0 if fault == "no light path" else path)) * law
            arriving += strength * scale**2 * lit[..., None] / (4 * math.pi)
        if fault == "hangs on the origin":
            arriving *= (1 + 0.2 * np.abs(point).max(axis=2) / scale)[..., None]
        density = np.exp(-attenuation * t) * sigma * dt
        airlight += arriving * density[..., None] * albedo
    if fault == "mixed colours":
        airlight = 0.7 * airlight + 0.3 * (airlight @ [0.2, 0.7, 0.1])[..., None]
    if fault == "lit density":
        airlight = 1 - np.exp(-airlight)
    if fault == "squared density":
        airlight *= sigma * scale / SIGMA
    if fault == "albedo as a colour":
        airlight *= (np.max(albedo) ** 1.2) / np.max(albedo)
    if fault == "counts lights":
        airlight += 0.01 * len(lamps)
    if fault == "counts pixels":
        airlight *= 1 + 20 / size[0]
    if fault == "noise":
        airlight = airlight * (1 + np.random.default_rng(seed).normal(0, 2, airlight.shape))
    through = np.exp(-attenuation * distance)[..., None]
    if fault == "capped":
        through = np.maximum(through, 0.5)
    wall = np.array([0.3, 0.4, 0.5]) if walled else np.zeros(3)
    surface = wall * through * np.ones_like(airlight)
    fog_light = ambient * (1 - (through**0.7 if fault == "ambient of its own" else through))
    background = ambient * through
    airlight = airlight * exposure + fog_light
    surface = surface * (1.0 if fault == "exposed fog" else exposure) + background
    return {"airlight": airlight, "surface": surface, "total": airlight + surface}


def camera_and_spot(fault, swapped):
    """Return the airlight of a camera with a spot in view; or of a camera in the place of the spot,
    with the spot in the place of the camera.
    """
    places = np.array([[0.0, 0.0, 0.0], [2.2, 2.6, 0.0]])
    towards = np.array([[0.25, 1.0, 0.0], [-1.0, 0.35, 0.0]])
    cones = np.radians([25.0, 34.0])
    (eye, lamp), (forward, axis) = (places[::-1], towards[::-1]) if swapped else (places, towards)
    seen, shone = cones[::-1] if swapped else cones
    side = 96
    camera = Camera(fov=70.0, forward=tuple(forward), cone=math.degrees(seen))
    direction = camera.directions(side, side)
    axis = axis / np.linalg.norm(axis)
    total, dt = np.zeros((side, side)), 0.05
    for step in range(240):
        t = (step + 0.5) * dt
        way = eye + t * direction - lamp
        r = np.linalg.norm(way, axis=2)
        cosine = way @ axis / r
        strength = np.maximum((cosine - math.cos(shone)) / (1 - math.cos(shone)), 0) ** 2
        law = 1 / (r * r + (1.0 if fault == "softened law" else 0.0))
        path = 6.0 if fault == "constant light path" else r
        depth = 0.5 * (t + (0.0 if fault == "no light path" else path))
        if fault == "planar depth":
            depth = depth - 0.5 * t * (1 - direction @ forward / np.linalg.norm(forward))
        total += strength * law * np.exp(-depth) * dt
    return camera, np.repeat(total[..., None], 3, axis=2)


TWO = ((LAMP, STRENGTH), (np.array([-0.9, 4.0, 0.2]), np.array([2.0, 6.0, 4.0])))
BLACK = (*TWO[:1], (TWO[1][0], np.zeros(3)))


def frames_of(fault):
    """Return the frames of all relations, and what is asked of them."""

    def one(**more):
        return render(fault, **more)

    order = [1, 2, 0]
    spot, seen = camera_and_spot(fault, swapped=False)
    other, swapped = camera_and_spot(fault, swapped=True)
    shown = {
        "base": one(),
        "again": one(seed=1),
        "twice": one(lamps=((LAMP, 2 * STRENGTH),), seed=2),
        "first": one(lamps=TWO[:1], seed=3),
        "second": one(lamps=TWO[1:], seed=4),
        "both": one(lamps=TWO, seed=5),
        "black": one(lamps=BLACK, seed=6),
        "permuted": one(lamps=((LAMP, STRENGTH[order]),), albedo=ALBEDO[order], seed=7),
        "doubled": one(scale=2.0, seed=8),
        "moved": one(place=(40.0, -7.0, 3.0), seed=9),
        "panned": one(turn=0.2, size=(96, 72), seed=10),
        "wide": one(size=(96, 72), seed=11),
        "large": one(size=(2 * SIZE[0], 2 * SIZE[1]), seed=12),
        "boxed": one(box=14.0, seed=13),
        "thin": one(sigma=SIGMA / 16, seed=14),
        "thinner": one(sigma=SIGMA / 32, seed=15),
        "thinnest": one(sigma=SIGMA / 64, seed=22),
        "clear": one(sigma=0.0, seed=16),
        "dense": one(sigma=2 * SIGMA, seed=17),
        "pale": one(albedo=ALBEDO / 2, seed=18),
        "stop": one(exposure=2.0, seed=19),
        "hazy": one(lamps=(), ambient=0.3, walled=False, seed=20),
        "foggy": one(lamps=(), ambient=0.3, walled=False, sigma=5 * SIGMA, seed=21),
        "seen": {"airlight": seen, "total": seen},
        "swapped": {"airlight": swapped, "total": swapped},
    }
    pan = tuple(Camera(FOV, forward=(math.sin(turn), math.cos(turn), 0.0)) for turn in (0.0, 0.2))
    asked = [
        Asked("intensity", ("base", "twice")),
        Asked("sum", ("first", "second", "both")),
        Asked("black-light", ("first", "black")),
        Asked("colours", ("base", "permuted")),
        Asked("units", ("base", "doubled")),
        Asked("moved", ("base", "moved")),
        Asked("pan", ("wide", "panned"), cameras=pan),
        Asked("size", ("base", "large")),
        Asked("bounds", ("base", "boxed")),
        Asked("thin", ("thin", "thinner", "thinnest")),
        Asked("depths-multiply", ("clear", "base", "dense")),
        Asked("albedo", ("pale", "base")),
        Asked("exposure", ("base", "stop")),
        Asked("furnace", ("hazy", "foggy"), value=(0.3, 0.3, 0.3)),
        Asked("reciprocity", ("seen", "swapped"), cameras=(spot, other)),
    ]
    return shown, asked


def answers(fault):
    shown, asked = frames_of(fault)
    return judge(asked, shown, again=("base", "again"), rounding=1e-6)


#: Each fault, and all the relations that it breaks.
FAULTS = {
    "": set(),
    "lit density": {"intensity", "sum", "albedo"},
    "counts lights": {"black-light", "intensity", "albedo", "thin"},
    "mixed colours": {"colours"},
    "softened law": {"units", "reciprocity"},
    "hangs on the origin": {"moved"},
    "planar depth": {"pan"},
    "counts pixels": {"size"},
    "constant light path": {"bounds", "reciprocity"},
    "squared density": {"thin"},
    "capped": {"depths-multiply"},
    "albedo as a colour": {"albedo"},
    "exposed fog": {"exposure"},
    "ambient of its own": {"furnace"},
    "no light path": {"reciprocity"},
}


@pytest.mark.claim("relations")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_breaks_the_relations_made_for_it_and_no_other(fault):
    found = answers(fault)
    assert [each.name for each in found] == list(RELATIONS)
    shown = [(each.name, each.verdict, each.error, each.limit) for each in found]
    assert {each.name for each in found if each.verdict == FAILS} == FAULTS[fault], shown
    assert {each.verdict for each in found} <= {HOLDS, FAILS}, shown


def test_light_that_no_lamp_makes_is_no_fault_of_twice_the_lamps():
    """All light with a sky failed for right renderers; a lit density is found beside it."""
    lamp = render("")["airlight"]
    sky = np.full_like(lamp, 2 * lamp.mean())
    frames = {"none": {"total": sky}, "base": {"total": lamp + sky}}
    frames |= {"twice": {"total": 2 * lamp + sky}, "half": {"total": 1.5 * lamp + sky}}

    def verdict(*names):
        (kept,) = judge([Asked("intensity", names)], frames, rounding=1e-6)
        return kept.verdict

    assert verdict("base", "twice", "none") == HOLDS
    assert verdict("base", "half", "none") == verdict("base", "twice") == FAILS


def test_each_relation_has_a_fault_of_its_own():
    broken = set().union(*FAULTS.values())
    assert broken == RELATIONS.keys() - {"again"}


@pytest.mark.claim("relations")
def test_noise_is_no_fault_and_hides_one():
    found = answers("noise")
    noisy = [
        each for each in found if each.name not in ("depths-multiply", "furnace", "reciprocity")
    ]
    assert {each.verdict for each in noisy} == {UNKNOWN}


@pytest.mark.claim("relations")
def test_more_noise_in_a_changed_frame_is_no_fault_and_a_wrong_pixel_is_one():
    """Cycles has hardly any noise with one lamp, and draws between two: its `sum` failed."""
    noise = np.random.default_rng(5).normal(size=(5, 48, 64, 3))
    frames = [1 + size * each for size, each in zip((1e-5, 1e-5, 1e-5, 7e-3, 0.0), noise)]
    names = ("first", "second", "again", "both", "quiet")
    frames[3] += 1
    shown = {name: {"total": frame} for name, frame in zip(names, frames)}
    asked = [Asked("sum", ("first", "second", "both"))]

    def verdict(again, **more):
        return judge(asked, shown | more, again=("first", again), rounding=1e-6)[-1].verdict

    assert verdict("again") == HOLDS
    # A fault of a hundredth is beyond that noise; without any, a few pixels are a fault.
    assert verdict("again", both={"total": 1.01 * frames[3]}) == FAILS
    wrong = np.full((48, 64, 3), 2.0)
    wrong[5::8, 5::8] *= 1.1
    still = {name: {"total": np.ones((48, 64, 3))} for name in ("first", "second", "quiet")}
    assert verdict("quiet", **still, both={"total": wrong}) == FAILS


def test_sets_of_relations_that_fail_together_name_a_term():
    assert "constant in metres" in signature(answers("softened law"))
    assert "constant length" in signature(answers("constant light path"))
    assert signature(answers("no light path")) == "no attenuation on the way from the light"
    assert signature(answers("")) == ""


def test_a_set_that_nobody_asked_in_full_is_as_likely_as_a_smaller_one():
    """`--only reciprocity` called a softened law a missing light path."""

    def said(**verdicts):
        rows = [
            Kept(name.replace("_", "-"), verdict, 0.1, 0.01, 1.0, "", "")
            for name, verdict in verdicts.items()
        ]
        return signature(rows)

    alone = said(reciprocity=FAILS)
    assert all(each in alone for each in ("on the way from the light", "in metres", "length"))
    told = said(reciprocity=FAILS, units=HOLDS, bounds=UNKNOWN, pan=HOLDS)
    assert "constant length" in told
    assert "in metres" not in told
    assert said(units=FAILS, reciprocity=FAILS).startswith("a law of distance")
    assert said(moved=FAILS) == ""


def test_what_holds_for_the_fog_alone_is_not_judged_by_all_light():
    """Right frames of fog and surfaces in one image broke `thin`, `albedo` and `depths-multiply`."""
    sigma, light = np.array([1.0, 0.5, 0.25]), np.ones((8, 8, 3))
    frames = {}
    for number, each in enumerate(sigma):
        airlight, surface = each * light, 5 * np.exp(number * sigma[2]) * light
        layers = {"airlight": airlight, "surface": surface, "total": airlight + surface}
        frames[f"thin-{number}"] = layers
    asked = [
        Asked("thin", ("thin-0", "thin-1", "thin-2")),
        Asked("albedo", ("thin-1", "thin-0")),
        Asked("depths-multiply", ("thin-0", "thin-1", "thin-2")),
    ]
    whole = {name: {"total": layers["total"]} for name, layers in frames.items()}
    for given, layer, verdict in (
        (frames, None, HOLDS),
        (whole, None, UNKNOWN),
        (whole, "total", FAILS),
    ):
        found = judge(asked, given, rounding=1e-6, layer=layer)
        assert {each.verdict for each in found} == {verdict}
        assert all("check.json" in each.points_to for each in found) is (verdict == UNKNOWN)
    # The floor of frames without that layer is the one that they have.
    found = judge(asked, frames | {"a": whole["thin-0"]}, again=("a", "a"), rounding=1e-6)
    assert {each.verdict for each in found} == {HOLDS}


def test_the_worst_place_is_in_pixels_of_the_frames():
    """`thin` compares means over 2 x 2 pixels, and named a place at half of the way to the fault."""
    frames = {
        name: {"total": value * np.ones((48, 64, 3))} for name, value in zip("abc", (4, 2, 1))
    }
    frames["b"]["total"][24:32, 40:48] *= 1.2
    (kept,) = judge([Asked("thin", tuple("abc"))], frames, rounding=1e-6, layer="total")
    column, row = map(int, kept.worst.split(", "))
    assert (40 <= column < 48, 24 <= row < 32) == (True, True)


def test_a_rim_falls_from_one_on_the_axis_to_nothing_at_the_edge():
    camera = Camera(60.0, cone=25.0)
    weights = {
        each: replace(camera, falloff=each).sensitivity(64, 64)
        for each in ("cosine", "rim:1", "rim:3")
    }
    assert weights["rim:1"] == pytest.approx(weights["cosine"])
    assert weights["rim:3"] == pytest.approx(1 - (1 - weights["cosine"]) ** 3)
    # A cone as wide as the frame is whole: 30 degrees in a frame of 60 were refused.
    for cone in (15.0, 30.0, 60.0):
        assert Camera(2 * cone, cone=cone).sensitivity(8, 8).max() > 0
    for words in ("rim:", "rim:0", "rim:nan", "rim:-1", "edge"):
        with pytest.raises(InputError, match="rim:POWER"):
            replace(camera, falloff=words).sensitivity(8, 8)


def test_nothing_lit_is_no_answer():
    dark = {"total": np.zeros((8, 8, 3))}
    (found,) = judge([Asked("units", ("a", "b"))], {"a": dark, "b": dark}, rounding=1e-6)
    assert (found.verdict, found.error, found.ratio) == (UNKNOWN, None, None)


def test_noise_that_is_not_known_is_not_zero():
    dark, lit = ({"total": np.full((8, 8, 3), value)} for value in (0.0, 1.0))
    frames = {"dark": dark, "also": dark, "a": lit, "b": lit}
    _, found = judge([Asked("units", ("a", "b"))], frames, again=("dark", "also"), rounding=1e-6)
    assert (found.verdict, found.error, found.limit) == (UNKNOWN, None, None)


def test_a_margin_allows_what_is_beyond_noise():
    one, other = ({"total": np.full((8, 8, 3), value)} for value in (1.0, 1.004))
    for margin, verdict in ((None, FAILS), (0.01, HOLDS), (0.001, FAILS)):
        asked = [Asked("units", ("a", "b"))]
        (found,) = judge(asked, {"a": one, "b": other}, rounding=1e-6, margin=margin)
        assert found.verdict == verdict
        assert found.error == pytest.approx(0.004)


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        (Asked("unit", ("a", "b")), "did you mean 'units'"),
        (Asked("units", ("a",)), "got 1 frames, expected 2"),
        (Asked("colours", ("a", "b"), order=(0, 0, 1)), "expected each of 0, 1, 2"),
        (Asked("intensity", ("a", "b"), factor=0.0), "expected one above 0"),
        (Asked("furnace", ("a", "b"), value=(1.0, 2.0)), "expected one radiance or three"),
        (Asked("units", ("a", "b"), layer="fogg"), "a: has no layer fogg; it has total"),
        (
            Asked("reciprocity", ("a", "b"), cameras=(Camera(60.0, cone=31.0),) * 2),
            "all of the cone",
        ),
        (
            Asked("reciprocity", ("a", "b"), cameras=(Camera(60.0, cone=-9.0),) * 2),
            "all of the cone",
        ),
        (Asked("pan", ("a", "b")), "expected two cameras"),
        (Asked("size", ("a", "b")), "twice the sides"),
        (Asked("units", ("a", "c")), "expected one size"),
        (Asked("units", ("a", "bad")), "are not finite"),
        (Asked("depths-multiply", ("a", "b", "airlight")), "has no layer"),
    ],
)
def test_what_cannot_be_judged_is_refused(asked, why):
    frames = {name: {"total": np.ones((8, 8, 3))} for name in ("a", "b")}
    frames["c"] = {"total": np.ones((8, 9, 3))}
    frames["bad"] = {"total": np.full((8, 8, 3), np.nan)}
    frames["airlight"] = {"airlight": np.ones((8, 8, 3))}
    with pytest.raises(InputError, match=why):
        judge([asked], frames, rounding=1e-6)


@pytest.mark.parametrize("again", [("a",), ("a", "a", "a")])
def test_another_number_of_frames_of_one_input_is_refused(again):
    frames = {"a": {"total": np.ones((8, 8, 3))}}
    with pytest.raises(InputError, match=f"again: got {len(again)} frames, expected 2"):
        judge([Asked("units", ("a", "a"))], frames, again=again, rounding=1e-6)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "is no JSON"),
        ("[]", "see docs/checks.md"),
        ('{"relations": [], "skema": 1}', "got the key 'skema'"),
        ('{"relations": [{"name": "units", "frames": ["a", "b"], "facter": 2}]}', "did you mean"),
        ('{"relations": [], "schema": "airlight-check/2"}', "expected 'airlight-check/1'"),
        ('{"relations": [], "format": "bf16"}', "expected one of float32, half, r11g11b10"),
    ],
)
def test_a_file_with_a_mistake_is_refused(tmp_path, text, why):
    (tmp_path / "check.json").write_text(text)
    with pytest.raises(InputError, match=why):
        read_check(tmp_path)
