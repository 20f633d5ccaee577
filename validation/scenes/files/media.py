# SPDX-License-Identifier: BSD-3-Clause
"""Coefficients of media as files have them, made into extinction and albedo.

Files of Mitsuba 0.5 and 0.6, and of its descendants, give scattering and absorption, of which

    sigma_t = sigma_s + sigma_a,        albedo = sigma_s / sigma_t,

or the name of a material, which is refused. The scale, which multiplies both, stays as it is.
"""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.reference.scene.transforms import matrix_of
from airlight.validation.arrays import Array
from airlight.validation.scenes.files.nodes import kind, of_kind, properties, references

_OLD = ("sigma_s", "sigma_a")


def give_extinction(state: mi.parser.ParserState) -> list[str]:
    """Give homogeneous media extinction and albedo in place of scattering and absorption;
    return notes on the changes.
    """
    notes = []
    for index in of_kind(state, "Medium"):
        props = properties(state, index)
        notes += _make_homogeneous(state, props)
        if props.plugin_name() != "homogeneous":
            continue
        _refuse_names(props)
        if "strategy" in props:  # of sampling, in version 0.6
            del props["strategy"]
        # Files of Mitsuba 3 give sigma_t: only a colour needs work, for its values above 1.
        old = [key for key in _OLD if key in props]
        if not old:
            if "sigma_t" in props and props.type("sigma_t") == mi.Properties.Type.Color:
                _set_extinction(props, np.array(props["sigma_t"], dtype=np.float64))
            continue
        sigma_t, albedo = _extinction(props)
        for key in old:
            del props[key]
        _set_extinction(props, sigma_t)
        props["albedo"] = mi.ScalarColor3d(*albedo.tolist())
        notes.append(
            f"medium '{props.id()}': {' and '.join(old)} are read as sigma_t {_words(sigma_t)} "
            "and albedo "
            f"{_words(albedo)}"
        )
    return notes


def _set_extinction(props: mi.Properties, sigma_t: Array) -> None:
    """Set an extinction, (3,) [1/m].

    Mitsuba takes a colour for a reflectance, from 0 to 1: a larger value goes into the scale.
    """
    if not np.all(np.isfinite(sigma_t)):
        given = ", ".join(f"{value:g}" for value in sigma_t)
        raise InputError(
            f"medium '{props.id()}': sigma_t is {given}; expected finite numbers [1/m]"
        )
    above = max(1.0, float(sigma_t.max()))
    props["scale"] = float(props.get("scale", 1.0)) * above
    props["sigma_t"] = mi.ScalarColor3d(*(sigma_t / above).tolist())


def _make_homogeneous(state: mi.parser.ParserState, props: mi.Properties) -> list[str]:
    """Make a heterogeneous medium homogeneous if its extinction is the same everywhere; return a
    note where Mitsuba 3 has it in a box alone.

    Files of version 0.5 and 0.6 call the extinction density.
    """
    old = "density" in props and "sigma_t" not in props
    if props.plugin_name() == "heterogeneous" and old:
        props["sigma_t"] = props["density"]
        del props["density"]
    # No volume at all means a plain number; `constvolume` is a volume with one value.
    volumes = [
        properties(state, at).plugin_name() for key, at in references(props) if key == "sigma_t"
    ]
    if (
        props.plugin_name() == "heterogeneous"
        and "sigma_t" in props
        and volumes in ([], ["constvolume"])
    ):
        props.set_plugin_name("homogeneous")
        for key in ("majorant_resolution_factor", "majorant_grid", "majorant_factor"):
            if key in props:
                del props[key]
        if not old:
            return [
                f"medium '{props.id()}': heterogeneous of one sigma_t is read as homogeneous, which "
                "ends at its shape alone; Mitsuba 3 also ends it at the unit cube, or where the "
                "to_world of its volume takes that: make it 'homogeneous' in a shape of these bounds"
            ]
    return []


def grey_densities(state: mi.parser.ParserState) -> None:
    """Mark media whose density is height fog or a grid as grey.

    Mitsuba 3.9.1 multiplies shadow rays through other media by exp(-m d)/exp(-m d), with the
    largest density m and the rest d of the way to the light, and by 0 where the exponential
    underflows: distant suns would not shine.
    """
    for index in of_kind(state, "Medium"):
        props = properties(state, index)
        volumes = {key: properties(state, at).plugin_name() for key, at in references(props)}
        if volumes.get("sigma_t") in ("heightfog", "gridvolume"):
            props["has_spectral_extinction"] = False


def give_own_parts(state: mi.parser.ParserState) -> None:
    """Give each medium and light its own phase function, coefficients and spectra: a change of one
    is then a change of no other.

    Mitsuba's parser makes one node of all that are equal, and one object of a node. A grid, which
    no change can name, stays shared.
    """
    taken = set[int]()
    for index in (*of_kind(state, "Medium"), *of_kind(state, "Emitter")):
        for key, at in list(references(properties(state, index))):
            part = kind(state, at)
            if part not in ("PhaseFunction", "Volume", "Texture"):
                continue
            if at in taken and properties(state, at).plugin_name() != "gridvolume":
                state.nodes.append(mi.parser.SceneNode(state.nodes[at]))
                at = len(state.nodes) - 1
                properties(state, index)[key] = mi.Properties.ResolvedReference(at)
            taken.add(at)


def mirrored_grids(state: mi.parser.ParserState) -> list[str]:
    """Return notes on grids that their to_world mirrors, which are read as Mitsuba reads them."""
    notes = []
    for index in of_kind(state, "Medium"):
        for _, at in references(properties(state, index)):
            volume = properties(state, at)
            if volume.plugin_name() != "gridvolume" or "to_world" not in volume:
                continue
            mirrored = np.linalg.det(matrix_of(volume["to_world"])[:3, :3]) < 0
            volume.mark_queried("to_world", False)
            if mirrored:
                notes.append(
                    f"medium '{properties(state, index).id()}': a negative scale in the to_world "
                    "of its grid mirrors it"
                )
    return notes


def pass_where_no_material(state: mi.parser.ParserState) -> None:
    """Give shapes of files before version 2 that bound a medium and have no
    material the material `null`.
    """
    for index in of_kind(state, "Shape"):
        node = state.nodes[index]
        kinds = {kind(state, at) for _, at in references(node.props)}
        # Before version 2 a shape with media and without a material let light pass; Mitsuba 3 gives
        # it a diffuse one.
        if (
            "Medium" in kinds
            and not kinds & {"BSDF", "Emitter"}
            and state.versions[node.file_index].major_version < 2
        ):
            null = mi.parser.SceneNode()
            null.type, null.props, null.file_index = (
                mi.ObjectType.BSDF,
                mi.Properties("null"),
                node.file_index,
            )
            node.props["no_material"] = mi.Properties.ResolvedReference(len(state.nodes))
            state.nodes.append(null)


def _refuse_names(props: mi.Properties) -> None:
    """Refuse the name of a material of Mitsuba 0.6, and a density."""
    name = f"medium '{props.id()}'"
    if "material" in props:
        raise InputError(
            f"{name} names the material '{props['material']}'; expected its sigma_t [1/m] and "
            "albedo in numbers"
        )
    if "density" in props:
        raise InputError(
            f"{name} has a density, which a homogeneous medium has not; expected sigma_t [1/m] and "
            "albedo: multiply "
            "sigma_t by the density and remove it"
        )


def _extinction(props: mi.Properties) -> tuple[Array, Array]:
    """Return extinction and albedo of a medium that has two of scattering, absorption
    and extinction.
    """
    # Any two of the three determine the third.
    coefficients = {
        key: values for key in (*_OLD, "sigma_t") if (values := _numbers(props, key)) is not None
    }
    if "albedo" in props or len(coefficients) != 2:
        given = ", ".join(key for key in (*_OLD, "sigma_t", "albedo") if key in props)
        raise InputError(
            f"medium '{props.id()}' has {given}; expected sigma_t and albedo, or sigma_s and "
            "sigma_a"
        )
    extinction = (
        coefficients["sigma_t"]
        if "sigma_t" in coefficients
        else coefficients["sigma_s"] + coefficients["sigma_a"]
    )
    scattering = (
        coefficients["sigma_s"]
        if "sigma_s" in coefficients
        else extinction - coefficients["sigma_a"]
    )
    if np.any((extinction == 0) & (scattering != 0)):
        raise InputError(
            f"medium '{props.id()}' has a sigma_t of 0 in a channel with sigma_s or sigma_a; "
            "expected sigma_t = sigma_s + sigma_a [1/m]"
        )
    # The albedo of a channel without extinction has no meaning, and is 0.
    return extinction, np.divide(scattering, extinction, out=np.zeros(3), where=extinction > 0)


def _numbers(props: mi.Properties, key: str) -> Array | None:
    """Return three values of a coefficient, None where it is not given."""
    if key not in props:
        return None
    value = props[key]
    # not `mi.Spectrum`, an array of the variant
    if type(value).__name__ == "Spectrum" and value.is_uniform():
        value = value.values
    try:
        numbers = np.array(value, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if numbers.size not in (1, 3):
        raise InputError(
            f"medium '{props.id()}': {key} is no number and no 'rgb'; expected sigma_t = sigma_s + "
            "sigma_a [1/m] and "
            "albedo = sigma_s / sigma_t in numbers"
        )
    return np.array(np.broadcast_to(numbers, 3))


def _words(values: Array) -> str:
    # A grey value is said once.
    values = values[:1] if np.ptp(values) <= 1e-6 * np.abs(values).max() else values
    return ", ".join(f"{value:.6g}" for value in values)
