# SPDX-License-Identifier: BSD-3-Clause
"""The rows of Bouthors, Neyret, Max, Bruneton, Crassin 2008."""

import numpy as np

from validation.fidelity.figures import Take, at, rate
from validation.fidelity.row import DIFFERS, AtLeast, AtMost, Bound, Equal, Evidence, Row
from validation.papers.bouthors_frames import PUBLISHED

_FORMULA = Equal(1e-9, "the printed formula over what it stands for, by quadrature")

_MIE = "Mie's theory at 0.55 um for r_e = 6 um, gamma = 2"
_SHARE = Equal(0.01, f"the share of the light by {_MIE}")

_SLAB = "sums over orders of a slab of the paper's droplets"
_SUN = "the sun at the zenith"


def _share(name: str, thickness: float, sun: float) -> Take:
    """Return what takes a share of Fig. 3 [%] at a thickness [m] and sun [degrees]."""

    def take(evidence: Evidence) -> float:
        rows = evidence["shares"]
        return 100 * float(next(row[name] for row in rows if (row["thickness"], row["sun"]) == (thickness, sun)))

    return take


def _least_reflected(evidence: Evidence) -> float:
    """Return the least share of orders 1 to 30 in what is reflected."""
    return 100 * min(float(row["reflected_1_30"]) for row in evidence["shares"])


def _of_reflectance(thickness: str, name: str, item: str, claim: str, tolerance: float, reason: str) -> Row:
    """Return a row on the reflectance of a slab over that of the droplets."""
    take = at("reflectance", thickness, name)
    return Row("bouthors", item, claim, Bound(1), "cloud slab", take, Equal(tolerance, reason))


#: What a slab decides. (`airlight published --paper bouthors` prints them too.)
SLAB_ROWS: tuple[Row, ...] = (
    Row(
        "bouthors",
        "Fig. 3, orders 31 and above, 100 m",
        "isotropic orders (31 and above) begin to appear at thicknesses over 100 m: their share reflected at 100 m",
        Bound(1),
        "cloud slab",
        _share("reflected_31_inf", 100.0, 0.0),
        AtMost(f"to begin to appear is read as 1 % or less below; {_SLAB}, {_SUN}"),
        unit="%",
    ),
    Row(
        "bouthors",
        "Fig. 3, orders 31 and above, 300 m",
        "... and are there beyond: their share reflected at 300 m",
        Bound(1),
        "cloud slab",
        _share("reflected_31_inf", 300.0, 0.0),
        AtLeast(f"to be there is read as 1 % or more; {_SLAB}, {_SUN}"),
        unit="%",
    ),
    Row(
        "bouthors",
        "Fig. 3, transmittance",
        "anisotropic orders (1 to 30) play a role up to 1000 m in transmittance: their share at 1000 m",
        Bound(1),
        "cloud slab",
        _share("transmitted_1_30", 1000.0, 0.0),
        AtLeast(f"a role is read as 1 % or more; {_SLAB}, {_SUN}"),
        unit="%",
    ),
    Row(
        "bouthors",
        "Fig. 3, reflectance",
        "anisotropic orders contribute to 30 % - 100 % of the reflectance: the least share up to 1000 m",
        30,
        "cloud slab",
        _least_reflected,
        Equal(0.1, f"the lower end of the range; {_SLAB}, thicknesses to 1000 m, suns at 0 and 75 degrees"),
        unit="%",
    ),
    Row(
        "bouthors",
        "Fig. 3, left, orders 19 to 30",
        "even high orders (up to 30) show an anisotropic behaviour: largest over least radiance by azimuth",
        Bound(1.1),
        "cloud slab",
        at("azimuth", "19-30"),
        AtLeast("anisotropic is read as a tenth or more; t = 1000 m, d = 100 m, the sun at 75 degrees"),
    ),
    Row(
        "bouthors",
        "Fig. 3, left, orders 31 and above",
        "orders over 30 show an isotropic behaviour: largest over least radiance by azimuth",
        Bound(1.1),
        "cloud slab",
        at("azimuth", "31-inf"),
        AtMost("isotropic is read as less than a tenth; t = 1000 m, d = 100 m, the sun at 75 degrees"),
    ),
    _of_reflectance(
        "50",
        "printed",
        "eq. 4, reflectance at 50 m",
        "reflectance of a slab of 50 m with the printed extinction over that with the droplets'",
        0.02,
        "both missing factors nearly cancel, and a quarter of the reflectance of a thin cloud stays",
    ),
    _of_reflectance(
        "300",
        "printed",
        "eq. 4, reflectance at 300 m",
        "the same at 300 m",
        0.02,
        "thicker clouds reflect most light whatever their extinction",
    ),
    _of_reflectance(
        "1000",
        "printed",
        "eq. 4, reflectance at 1000 m",
        "the same at 1000 m",
        0.02,
        "thicker clouds reflect most light whatever their extinction",
    ),
    _of_reflectance(
        "50",
        "half",
        "A, half the density, 50 m",
        "modified Mie yields equivalent results: reflectance of 50 m with half the density over that of full Mie",
        0.02,
        "half the density is less than what is left of the light, 56 %",
    ),
    _of_reflectance(
        "50",
        "modified",
        "A, matched density, 50 m",
        "the same with a density that loses what is cut",
        0.005,
        "what is cut is what the density loses",
    ),
    _of_reflectance(
        "50",
        "printed_g",
        "Fig. 2, Henyey-Greenstein, 50 m",
        "Henyey-Greenstein with g = .99 gives far from accurate effects: its reflectance of 50 m over that of Mie",
        0.1,
        "a function this forward reflects next to nothing; Mie's mean cosine is 0.85",
    ),
    _of_reflectance(
        "300",
        "matched",
        "2.2, Henyey-Greenstein matched, 300 m",
        "Henyey-Greenstein gives far from accurate effects: with Mie's g, reflectance of 300 m over that of Mie",
        0.01,
        "of the light that leaves a thick cloud the mean cosine decides; glory and fogbow are what it lacks",
    ),
)


def _half_fitted(evidence: Evidence) -> float:
    """Return the median over the curves of Fig. 8 of what half of their directions are within [%]."""
    curves = evidence["transport"]["curves"]
    return 100 * float(np.median([curve["fit_p50"] for curve in curves if curve["fit_p50"] is not None]))


#: The light of a slab by direction. (`airlight published --paper bouthors` prints it too.)
TRANSPORT_ROWS: tuple[Row, ...] = (
    Row(
        "bouthors",
        "Fig. 8",
        "Figure 8 shows the result of this fitting, curves close to the simulation: its error in half the directions",
        Bound(10),
        "cloud transport",
        _half_fitted,
        AtMost("to lie on one another is read as 10 %; the 22 functions, fitted here, the median over curves"),
        unit="%",
    ),
)

_SHAPE = "the paper's cloud is not at hand; the light of the image in these pixels over that of light paths"

#: What clouds look like. (`airlight published --paper bouthors` prints it too.)
IMAGE_ROWS: tuple[Row, ...] = (
    Row(
        "bouthors",
        "Fig. 11a",
        "the radiance of surfaces shaded across a gap is underestimated: over that of the truth, in ring",
        Bound(1),
        "cloud images",
        at("gap", "shaded"),
        AtMost(_SHAPE, DIFFERS),
    ),
    Row(
        "bouthors",
        "Fig. 11a, importance",
        "... this error is of low visual importance: what these surfaces lack of the light of the image",
        Bound(5),
        "cloud images",
        at("gap", "lost", scale=100.0),
        AtMost("low is read as 5 %; the paper's cloud is not at hand", DIFFERS),
        unit="%",
    ),
    Row(
        "bouthors",
        "Fig. 11b",
        "where two collectors exist one is found, and light underestimated: over that of the truth, in two-lobes",
        Bound(1),
        "cloud images",
        at("lobes", "two"),
        AtMost(_SHAPE, DIFFERS),
    ),
    *(
        Row(
            "bouthors",
            f"Fig. 12, {scene}",
            f"treating accurately light paths of all orders: light of the image over that of the truth, {scene}",
            Bound(1),
            "cloud images",
            at("results", scene, "light"),
            Equal(0.1, "accurate is read as a tenth; 80 x 60", DIFFERS),
        )
        for scene in ("stratocumulus", "cumulus")
    ),
)

_MACHINE = AtLeast(
    "another machine, no graphics card, clouds of the same kinds: asked is whether the published rate is reached",
    DIFFERS,
)


def _rate(scene: str) -> Take:
    """Return what takes the frames a second of a scene."""
    return lambda evidence: rate(evidence["frames"][scene]["light_moved"])


#: Frames a second. (`airlight published --paper bouthors` prints them too.)
FRAME_ROWS: tuple[Row, ...] = (
    *(
        Row(
            "bouthors",
            f"9, {published.scene}",
            f"frames a second of {published.words}, 800 x 600",
            published.fps,
            "cloud frames",
            _rate(published.scene),
            _MACHINE,
            unit="frames/s",
            command="airlight published --paper bouthors",
        )
        for published in PUBLISHED
    ),
)

PUBLISHED_ROWS: tuple[Row, ...] = (*SLAB_ROWS, *TRANSPORT_ROWS, *IMAGE_ROWS, *FRAME_ROWS)

ROWS: tuple[Row, ...] = (
    Row(
        "bouthors",
        "eq. 1",
        "single scattering of a segment, for l linear on it: printed over derived",
        Bound(1),
        "printed",
        at("clouds", "scattering"),
        _FORMULA,
    ),
    Row(
        "bouthors",
        "eq. 2",
        "opacity of a segment: printed over derived",
        Bound(1),
        "printed",
        at("clouds", "opacity"),
        _FORMULA,
    ),
    Row(
        "bouthors",
        "eq. 4",
        "kappa = rho N0 pi r_e^2 with r_e = (gamma + 2) r_n: printed over the mean square radius, gamma = 2",
        Bound(1),
        "printed",
        at("clouds", "radius"),
        _FORMULA,
    ),
    Row(
        "bouthors",
        "eq. 5",
        "radiative transfer: the change of an isotropic field without absorption, in units of the field",
        Bound(0),
        "printed",
        at("clouds", "conservation"),
        Equal(0, "in a medium of albedo 1 what is scattered out comes back"),
    ),
    Row(
        "bouthors",
        "eq. 4, extinction",
        "kappa = rho N0 pi r_e^2: printed over the extinction of the droplets",
        Bound(1),
        "droplets",
        at("extinction"),
        Equal(0.01, f"{_MIE}; the mean square radius and the efficiency, both missing, nearly cancel"),
    ),
    Row(
        "bouthors",
        "2.3, mean free path",
        "the mean free path of a light ray is about 20 m",
        20,
        "droplets",
        at("path"),
        Equal(0.25, f"{_MIE}, 4e8 droplets in a cubic metre; about is read as a quarter"),
        unit="m",
    ),
    Row(
        "bouthors",
        "2.2, forward peak",
        "the Mie function combines a strong narrow forward peak (51 % of energy), ...: the share below 5 degrees",
        51,
        "droplets",
        at("peak", scale=100.0),
        _SHARE,
        unit="%",
    ),
    Row(
        "bouthors",
        "2.2, forward lobe",
        "... a wide forward lobe (48 % of energy), ...: the share from 5 to 90 degrees",
        48,
        "droplets",
        at("lobe", scale=100.0),
        _SHARE,
        unit="%",
    ),
    Row(
        "bouthors",
        "2.3, forward scattering",
        "99 % of the light is scattered in the forward direction",
        99,
        "droplets",
        at("forward", scale=100.0),
        _SHARE,
        unit="%",
    ),
    Row(
        "bouthors",
        "Fig. 2, Henyey-Greenstein",
        "Henyey-Greenstein with g = .99 stands beside Mie: the mean cosine of Mie",
        0.99,
        "droplets",
        at("g"),
        Equal(0.01, f"a function with the same mean cosine is wanted beside {_MIE}"),
    ),
    Row(
        "bouthors",
        "A, lowered density",
        "the 5 degrees of the forward peak are converted into 50 % lowered density: what a density must lose",
        50,
        "droplets",
        at("cut", scale=100.0),
        Equal(0.01, f"what is cut is what the density loses, by {_MIE}"),
        unit="%",
    ),
    Row(
        "bouthors",
        "A, equivalent results",
        "modified Mie yields equivalent results, the density as printed: light scattered aside over that of full Mie",
        Bound(1),
        "droplets",
        at("conserved", "printed"),
        Equal(0.01, "with half the density the cut function scatters less light aside than the full one"),
    ),
    Row(
        "bouthors",
        "A, equivalent results, matched",
        "the same, with a density that loses what is cut",
        Bound(1),
        "droplets",
        at("conserved", "matched"),
        Equal(0.01, "the scheme is right: what is cut is what the density loses"),
    ),
    Row(
        "bouthors",
        "2.2, Henyey-Greenstein",
        "approximations give far from accurate visual effects: Fig. 2's over Mie's mean value backward",
        Bound(0.5),
        "droplets",
        at("back"),
        AtMost("far from accurate is read as half or less; no glory and no fogbow can be left then"),
    ),
    *PUBLISHED_ROWS,
)
