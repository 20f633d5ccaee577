# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.export`: an airlight kernel as shader code; the conformance kit."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from airlight.errors import InputError
from airlight.reference.storage.build import build
from airlight.reports.api.inputs import File, Files, exclude, one_error, output_files
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Column, Table, table

#: The largest errors, as `python -m tests.helpers.exported` measured them.
MEASURED = Path(__file__).parents[1] / "data" / "exported.json"

#: Kinds of certified rays that a test of an exported text has one of each.
_KINDS = ("generic", "near_light", "behind", "beyond", "far", "infinite", "thick", "vacuum")


@dataclass(frozen=True, repr=False)
class Exported(Result):
    """An airlight kernel as shader code."""

    kernel: str
    language: str
    phase: str
    code: str  #: the whole text
    error: float | None  #: largest relative error on certified rays; None where it was not measured
    written: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """The kernel, the phase function and the language."""
        return f"{self.kernel}, {self.phase}, {self.language}"

    @property
    def lines(self) -> list[str]:
        """The text, or where it was written."""
        return [f"wrote {path}" for path in self.written] or [self.code.rstrip("\n")]


@dataclass(frozen=True)
class KitGroup:
    """Certified rays of one quantity in the kit."""

    name: str
    value: str  #: the quantity, as a formula
    rays: int


@dataclass(frozen=True)
class KitScene:
    """A certified scene in the kit."""

    name: str
    files: tuple[str, ...]  #: in the folder of the kit
    gaps: tuple[str, ...]  #: what a form of it lacks, in words


@dataclass(frozen=True, repr=False)
class Kit(Result):
    """The conformance kit as it was written."""

    folder: str
    files: tuple[str, ...]  #: in the folder, those of scenes excepted
    groups: tuple[KitGroup, ...]
    scenes: tuple[KitScene, ...]

    @property
    def title(self) -> str:
        """How much is in it."""
        rays = sum(group.rays for group in self.groups)
        return f"conformance kit: {rays} certified rays, {len(self.scenes)} scenes"

    @property
    def tables(self) -> Sequence[Table]:
        """The groups of rays, and the scenes with what they lack."""
        rays = table(
            "rays",
            (
                Column("group", "group", words=True),
                Column("rays", "rays"),
                Column("value", "a function returns", words=True, long=True),
            ),
            [(group.name, group.rays, group.value) for group in self.groups],
        )
        scenes = table(
            "scenes",
            (
                Column("scene", "scene", words=True),
                Column("files", "files"),
                Column("gaps", "not there, or not as certified", words=True, long=True),
            ),
            [(scene.name, len(scene.files), "; ".join(scene.gaps)) for scene in self.scenes],
        )
        return rays, scenes

    @property
    def lines(self) -> list[str]:
        """Where the kit was written, and the page to read first."""
        count = len(self.files) + sum(len(scene.files) for scene in self.scenes)
        return [f"wrote {count} files into {self.folder}", f"read {self.folder}/README.md first"]


@one_error
def export(
    kernel: str = "exact",
    *,
    language: Literal["glsl", "hlsl", "wgsl", "slang"] = "glsl",
    phase: str = "isotropic",
    test: bool = False,
    output: Files = (),
    kit: File | None = None,
) -> Exported | Kit:
    """Print an airlight kernel as shader code, to paste into an engine; write the conformance kit.

    The functions are `al_integral`, the airlight integral J [1/m]; `al_ray`, foot and height of a
    light over a ray; and `al_airlight`, the radiance. The head of the text says what they take, and
    the largest error and where it was measured. The text may be used without a notice (MIT-0). GLSL
    is for 4.30 and ES 3.00 with `precision highp float` and `precision highp int`.

    The conformance kit tests code of your own: certified rays in C, Rust, JavaScript, GLSL and
    JSON, and certified scenes for Mitsuba, pbrt, glTF, Blender and Godot, with the expected pixels.

    Parameters
    ----------
    kernel
        'exact', or 'quadrature-N' with N nodes, whose cost is fixed.
    language
        glsl, hlsl, wgsl or slang.
    phase
        isotropic, rayleigh, hazy, murky, hg (g is an argument) or hg-draine:D, D the
        diameter of droplets [um].
    test
        Add `al_test`, the largest relative error over eight rays whose integral is known.
    output
        Write the text to this file.
    kit
        Write the conformance kit into this folder, which is new or empty, and no kernel.

    Raises
    ------
    InputError
        For a kernel, language or phase function that cannot be exported, and for a folder that
        has files.

    Examples
    --------
    >>> import airlight
    >>> "float al_integral(" in airlight.export("exact", phase="hg").code
    True
    """
    from airlight.realtime.export.text import kernel_text
    from airlight.realtime.scene.phase import named_phase
    from airlight.reference.storage.files import write_text

    if kit is not None:
        beside = {
            "kernel": kernel != "exact",
            "language": language != "glsl",
            "phase": phase != "isotropic",
            "test": test,
            "output": output,
        }
        exclude("kit", "it is written with all of its languages", beside)
        return _kit(Path(kit))
    # The text takes g as an argument, and it has no room for tables: phase functions with tables or
    # with a value of g cannot be exported.
    if phase.startswith(("hg:", "tabulated", "mie")):
        raise InputError(
            f"phase: got {phase!r}, expected isotropic, rayleigh, hazy, murky, hg (g is an "
            "argument) or hg-draine:D"
        )
    files = output_files(output)
    # With --test the text also holds certified rays, by which the user tests it on the user's own
    # device.
    rows = _rows(phase) if test else ()
    code = kernel_text(kernel, named_phase(phase), language, rows)
    # The head says the error of the text as it was measured, and does not promise one that was not.
    error, words = _measured(kernel, phase)
    command = f"airlight export {kernel} --language {language} --phase {phase}"
    command += " --test" if test else ""
    text = _head(kernel, language, phase, command, words) + code
    for path in files:
        write_text(path, text)
    return Exported(kernel, language, phase, text, error, tuple(map(str, files)))


def _kit(folder: Path) -> Kit:
    from airlight.reports.kit.write import write_kit
    from airlight.reports.machine.environment import activate

    # Mitsuba reads the scenes that are written as glTF and for pbrt.
    activate()
    written = write_kit(folder)
    groups = [KitGroup(group.name, group.value, len(group.rows)) for group in written.groups]
    scenes = [KitScene(scene.name, scene.files, scene.gaps) for scene in written.scenes]
    return Kit(str(folder), written.files, tuple(groups), tuple(scenes))


def _head(kernel: str, language: str, phase: str, command: str, measured: str) -> str:
    return f"""// The airlight of a point light in homogeneous fog: kernel {kernel}, phase function {phase}, {language}.
// Written by airlight {build().words} ({command}).
// SPDX-License-Identifier: MIT-0. Copy, change and sell it without a notice; there is no warranty.
// Lengths in m, extinction in 1/m, intensity in W/sr, radiance in W/(m^2 sr).
// Range: 0 <= x0 <= x1, sigma_t >= 0, -1 < g < 1. A ray that meets the light gives a large number.
// {measured}
// al_ray has the height to 6e-8 of the light's distance: where it is a thousandth of it, J has four digits.

"""


def _measured(kernel: str, phase: str) -> tuple[float | None, str]:
    """Return the largest error of a kernel that was measured, and a sentence."""
    import json

    from airlight.realtime.export.text import CONFORMING

    # Errors are per kernel and phase function; a pair that the file lacks was not measured.
    data = json.loads(MEASURED.read_text(encoding="utf-8"))
    entry = data["errors"].get(kernel, {}).get(phase)
    if entry is None:
        return (
            None,
            "Largest relative error of J: not measured for this kernel and phase function; see "
            "al_test.",
        )
    error, count = entry["error"], entry["rays"]
    words = f"Largest relative error of J: {error:.1e} on {count} certified rays, GLSL on {data['device']}"
    # Only the text of the exact kernel was also run by a simulated device that rounds as badly as
    # Vulkan permits.
    if kernel == "exact":
        words += f";\n// on any device that keeps the bounds of Vulkan at most {CONFORMING:.0e}, by simulation"
    return error, f"{words}."


def _rows(phase: str) -> list[tuple[float, ...]]:
    """Return eight certified rays; of a phase function without any, rays
    with the integral to 1e-10.
    """
    import numpy as np

    from airlight.analytic.panels import airlight_segments
    from airlight.analytic.phase import phase_from_words
    from airlight.validation.certified.files import certified_data
    from airlight.validation.kernels.case_files import read_cases

    cases = read_cases(certified_data("airlight_integral.csv"))
    assert cases.tag is not None
    assert cases.value is not None
    # The certified file has rays for some phase functions. For another one the isotropic rays give
    # the geometry, and the values are integrated below.
    certified_phase = phase if phase in cases.phase else "isotropic"
    # Values that float32 holds well: those beyond 60 optical depths are
    # close to its smallest number.
    picked = np.array(cases.phase) == certified_phase
    picked &= cases.value > 1e-20
    # One ray of each kind: a shader can be right on generic rays and wrong beside the light.
    indices = [np.flatnonzero(picked & (np.array(cases.tag) == kind))[0] for kind in _KINDS]
    foot, height, x0, x1, sigma_t, g, values = (
        getattr(cases, name)[indices]
        for name in ("foot", "height", "x0", "x1", "sigma_t", "g", "value")
    )
    # Gauss-Kronrod panels stand for the certified value here, to 1e-10.
    if certified_phase != phase:
        values, _ = airlight_segments(foot, height, x0, x1, sigma_t, phase_from_words(phase))
    return list(
        zip(
            *(column.tolist() for column in (foot, height, x0, x1, sigma_t, g, values)), strict=True
        )
    )
