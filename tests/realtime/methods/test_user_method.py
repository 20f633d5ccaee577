# SPDX-License-Identifier: BSD-3-Clause
"""A user's function is a method: its parameters, its result, and its faults with file and line."""

import re
import sys

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import find_method
from airlight.realtime.methods.user_method import user_object
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.parameters import defaults
from airlight.realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene

SOURCE = """
import drjit as dr
import mitsuba as mi
import numpy as np
from airlight.errors import InputError
from dataclasses import dataclass
from airlight.realtime.methods.interface.method import Layers, Method

NUMBER = 3

def grey(view, gain=0.5): return mi.Float(gain)
def vector(view): return mi.Vector3d(1, 2, 3)
def plain(view): return np.array([[0.25, 0.5, 1.0]]) * np.ones((dr.width(view.pixel), 1))
def constant(view): return 2
def nothing(view): pass
def turned(view): return np.ones((3, dr.width(view.pixel)))
def dark(view): return np.where(np.arange(dr.width(view.pixel)) == dr.width(view.pixel) - 1, np.nan, 1.0)
def wants(view, steps): return 1

def divides(view):
    'Divide by zero.'
    return 1 / (NUMBER - 3)

def refuses(view):
    import airlight
    raise airlight.InputError("refuses: expected less")

def loops(view):
    def body(i):
        raise ValueError("in the\\nloop")
    return dr.while_loop((mi.UInt32(0),), lambda i: i < 3, body)

def calls(view, *, kernel=None, steps=7, fraction=0.5, word="a", on=True, other=None, **rest):
    return 1.0 if callable(kernel) else 0.0
calls.shadows = False
calls.frozen = calls.by_rays = True

def ready(view, size=2): return mi.Color3f(view.prepared[0])
ready.prepare = lambda scene, size: lambda scene: (float(size),)
def unready(view): return 1
unready.prepare = lambda scene: None
def averaged(view, *, history=0.9): return 1
def hidden(view, *, shadows=False): return 1
def drawn(view, *, render=1): return 1
@dataclass(frozen=True)
class Averaged(Method):
    history: float = 0.9
@dataclass(frozen=True)
class Shifted(Method):
    uses_kernel = False
    jitter: float = 0.25
    def render(self, view, state, kernel): return Layers(self.jitter)
@dataclass(frozen=True)
class Record(Method):
    uses_kernel = False
    def render(self, view, state, kernel): return Layers(2)
@dataclass(frozen=True)
class Lights(Record):
    provides_visibility = True
"""


def refused(text):
    return pytest.raises(InputError, match=re.escape(text))


@pytest.fixture
def own(tmp_path):
    """A file of methods, good and bad; its path."""
    path = tmp_path / "own_for_tests.py"
    path.write_text(SOURCE)
    return str(path)


@pytest.fixture
def render(own, variant):
    """Render the tiny scene by a method of that file."""
    scene = read_scene(mi.load_dict(tiny_scene()))

    def rendered(name, **parameters):
        renderer = frame_renderer(
            scene, find_method(f"{own}:{name}"), kernel=KERNELS["exact"], **parameters
        )
        return render_frame(renderer).airlight

    return rendered


@pytest.mark.claim("own-method-parameters")
def test_the_signature_decides(own):
    method = find_method(f"{own}:calls")
    assert method.uses_kernel
    assert defaults(method) == {"steps": 7, "fraction": 0.5, "word": "a", "on": True}
    assert (method.shadows, method.frozen, method.by_rays, method.casts_rays) == (
        False,
        True,
        True,
        True,
    )
    method = find_method(f"{own}:divides")
    assert not method.uses_kernel
    assert (defaults(method), method.shadows, method.frozen) == ({}, True, False)
    assert (method.summary, method.source) == ("Divide by zero.", own)


@pytest.mark.claim("own-method-results")
@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("vector", (1, 2, 3)),
        ("plain", (0.25, 0.5, 1)),
        ("constant", (2, 2, 2)),
        ("calls", (1, 1, 1)),
        ("ready", (2, 2, 2)),
        ("Record", (2, 2, 2)),
        ("Shifted", (0.25, 0.25, 0.25)),
    ],
)
def test_what_is_returned_becomes_an_image(render, name, wanted):
    np.testing.assert_array_equal(render(name), np.broadcast_to(wanted, (12, 16, 3)))


def test_arguments_with_defaults_are_parameters(render):
    assert render("ready", size=5)[3, 4, 1] == 5


@pytest.mark.claim("own-method-results")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nothing", "returned a NoneType; expected the radiance of every pixel"),
        ("turned", "returned an array of shape (3, 192) for 192 pixels"),
        ("dark", "of 1 of 192 pixels is not finite, first in column 15 of row 11: nan, nan, nan"),
        ("Lights", "returned the visibility of 0 lights, expected 1: one for each light"),
        ("unready", "`prepare` returned a NoneType; expected a function of the scene"),
    ],
)
def test_a_wrong_result_is_refused_with_the_name_and_what_came(render, own, name, message):
    with refused(message) as caught:
        render(name)
    assert f"method {own}:{name}: " in str(caught.value)


@pytest.mark.claim("own-method-faults")
def test_an_exception_names_file_and_line(render, own):
    lines = SOURCE.splitlines()
    for name, text, kind in (
        ("divides", "return 1 / (NUMBER - 3)", "ZeroDivisionError: division by zero"),
        ("loops", "raise ValueError", "ValueError: in the loop"),
    ):
        number = next(number for number, line in enumerate(lines, 1) if text in line)
        with refused(f"method {own}:{name}: {own}, line {number}: {kind}") as caught:
            render(name)
        assert caught.value.__cause__ is not None


@pytest.mark.claim("own-method-faults")
def test_what_a_method_refuses_is_no_fault(render):
    """Its words stand alone, whichever of the two classes it raises: a fault would have
    file and line before them.
    """
    with pytest.raises(InputError, match=r"^refuses: expected less$"):
        render("refuses")


@pytest.mark.claim("own-method-parameters")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("gone", "has no 'gone'; it has grey, vector"),
        ("NUMBER", "this is a int; expected a function of the view"),
        ("wants", "nothing gives 'steps' a value; expected a keyword with a default"),
        ("averaged", "a parameter cannot be called history, a name that frames use; rename it"),
        ("hidden", "a parameter cannot be called shadows"),
        ("drawn", "a parameter cannot be called render"),
        ("Averaged", "a parameter cannot be called history"),
    ],
)
def test_what_is_no_method_is_refused(own, name, message):
    with refused(message):
        find_method(f"{own}:{name}")


def test_a_number_called_jitter_makes_no_method_noisy(own):
    """`jitter` names a pattern of the built-in methods; a user's may be the length of a shift."""
    assert not find_method(f"{own}:Shifted")().noisy
    assert find_method("ray-march")(jitter="blue").noisy


@pytest.mark.claim("own-method-faults")
def test_faults_in_the_file_are_told_with_their_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken_for_tests.py").write_text("def f(view):\n    return (\n")
    (tmp_path / "imports_for_tests.py").write_text("\nimport not_there_for_tests\n")
    for module in ("broken_for_tests", "broken_for_tests.py"):
        with refused("broken_for_tests.py, line 2: SyntaxError"):
            find_method(f"{module}:f")
    for module in ("imports_for_tests", "imports_for_tests.py"):
        with refused(
            "imports_for_tests.py, line 2: ModuleNotFoundError: No module named "
            "'not_there_for_tests'"
        ):
            find_method(f"{module}:f")


def test_a_file_has_its_own_neighbours_as_they_are_now(tmp_path):
    """Two folders have a module of one name, and one of them is edited, also after a failure."""

    def shown(folder):
        return user_object(f"{folder}/fog.py:value", "method")

    first, second = tmp_path / "first", tmp_path / "second"
    for number, folder in enumerate((first, second)):
        folder.mkdir()
        (folder / "fog.py").write_text("import tones_beside\nvalue = tones_beside.value\n")
        (folder / "tones_beside.py").write_text(f"value = {number}\n")
    assert [shown(folder) for folder in (first, second, first)] == [0, 1, 0]
    (first / "tones_beside.py").write_text("value = 12345\n")
    assert [shown(folder) for folder in (first, second)] == [12345, 1]
    (first / "fog.py").write_text("import tones_beside\nvalue = 1 / tones_beside.zero\n")
    with pytest.raises(InputError, match="has no attribute 'zero'"):
        shown(first)
    (first / "tones_beside.py").write_text("zero = 0.5\n")
    assert shown(first) == 2


def test_loading_leaves_nothing_beside_the_file(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)  # as it is where nothing is set
    (tmp_path / "neighbour.py").write_text("strength = 1.0\n")
    (tmp_path / "mine.py").write_text(
        "from neighbour import strength\ndef fog(view):\n    return strength\n"
    )
    find_method(f"{tmp_path / 'mine.py'}:fog")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.py", "neighbour.py"]
    assert not sys.dont_write_bytecode


@pytest.mark.claim("own-method-frozen")
def test_only_a_method_that_says_so_is_frozen(own, variant):
    scene = read_scene(mi.load_dict(tiny_scene()))
    assert not isinstance(
        frame_renderer(scene, find_method(f"{own}:constant")).stages.render, Frozen
    )
    assert isinstance(
        frame_renderer(scene, find_method(f"{own}:calls"), kernel=KERNELS["exact"]).stages.render,
        Frozen,
    )
