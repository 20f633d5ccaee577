# SPDX-License-Identifier: BSD-3-Clause
import sys

import pytest

from validation.mutations.module_copies import ModuleCopies, imported_modules, module_source, replaced_once, users_of

TOPS = ("reference.quadrature.image", "reference.scene.read")


def test_a_copy_leaves_the_originals_alone():
    import reference.scene.read
    from analytic.phase import PhaseFunction

    before = dict(sys.modules)
    changed = replaced_once("analytic.phase", "return np.ones_like(up)", "return 7 * np.ones_like(up)")
    copies = ModuleCopies("analytic.phase", changed, TOPS)
    assert copies["analytic.phase"].PhaseFunction("isotropic")(0.3) == 7
    assert PhaseFunction("isotropic")(0.3) == 1
    # A user of the changed module sees the change, and the interpreter knows nothing of it.
    assert copies["reference.scene.read"].PhaseFunction is copies["analytic.phase"].PhaseFunction
    assert copies["reference.scene.read"] is copies["reference.scene.read"]
    assert reference.scene.read.PhaseFunction is PhaseFunction
    assert {name: module for name, module in sys.modules.items() if name in before} == before
    assert not [name for name in sys.modules if "__copy" in name]


def test_what_does_not_lead_to_the_change_is_shared():
    copies = ModuleCopies("reference.visibility.spot_cone", module_source("reference.visibility.spot_cone"), TOPS)
    assert "reference.quadrature.image" in set(copies)
    assert len(copies) == len(set(copies))
    assert copies["analytic.phase"] is sys.modules["analytic.phase"]
    assert (
        copies["reference.quadrature.light_airlight"].foot_and_height
        is sys.modules["analytic.geometry"].foot_and_height
    )


def test_imports_inside_functions_are_served_too():
    source = "def ask():\n    from analytic.kronrod import WIDE\n    return WIDE\n"
    copies = ModuleCopies("analytic.panels", source, ("analytic.panels",))
    assert copies["analytic.panels"].ask() is sys.modules["analytic.kronrod"].WIDE
    changed = "from analytic.errors import InputError\n"
    copies = ModuleCopies("analytic.errors", "InputError = 'changed'\n", ("analytic.errors",))
    assert imported_modules(changed) == {"analytic.errors"}
    namespace = copies["analytic.errors"].__dict__
    exec("def ask():\n    from analytic.errors import InputError\n    return InputError\n", namespace)
    assert namespace["ask"]() == "changed"


def test_a_module_imported_as_a_whole_cannot_be_copied():
    copies = ModuleCopies("analytic.errors", "", ("analytic.errors",))
    namespace = copies["analytic.errors"].__dict__
    for line in ("import analytic.errors", "from analytic import errors"):
        with pytest.raises(ImportError, match="as a whole"):
            exec(line, namespace)


def test_users():
    users = users_of("analytic.panels", TOPS)
    assert {"analytic.panels", "reference.quadrature.unbounded", "reference.quadrature.image"} <= users
    assert "reference.scene.read" not in users
    assert imported_modules("from reference.visibility import lit_intervals\nimport numpy\n") == {
        "reference.visibility",
        "reference.visibility.lit_intervals",
    }


@pytest.mark.parametrize(("text", "times"), [("no such text", 0), ("import", 12)])
def test_a_text_that_is_not_there_exactly_once_is_refused(text, times):
    with pytest.raises(ValueError, match="wanted exactly once") as raised:
        replaced_once("analytic.panels", text, "")
    assert ("0 times" in str(raised.value)) == (times == 0)
