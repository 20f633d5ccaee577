# SPDX-License-Identifier: BSD-3-Clause
"""The command `airlight report`: what it refuses, and what it hands on; nothing is
measured here but tiny frames.
"""

from contextlib import contextmanager

import numpy as np
import pytest

from airlight.reference.storage.exr import Image, write_exr
from airlight.reports.commands.main import run
from tests.helpers.api import brighter
from tests.helpers.reports import checked, report_of

METHOD = """
print("at import")


def half(view, *, kernel=None):
    from airlight.realtime.methods.unshadowed import unshadowed
    return 0.5 * unshadowed(view, kernel=kernel)


def broken(view):
    return {}["nothing"]


def flat(view):
    import numpy as np
    return np.zeros((3, 7))


def hangs(view):
    while True:
        pass


def crashes(view):
    import os
    os.abort()


def exits(view):
    print("farewell")
    raise SystemExit(0)


def darkens(view):
    if len(view.pixel) > 64 * 48:
        raise RuntimeError("too large")
    return 1.0
"""


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A folder with a user's module, made current."""
    (tmp_path / "fog_of_mine.py").write_text(METHOD)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def handed_on(monkeypatch):
    """The arguments that the command hands to `write_report`."""
    given = {}

    def write(folder, study, **options):
        given.update(
            options,
            folder=folder,
            study=study,
            scenes=study.scenes,
            configurations=study.configurations,
        )
        return checked(
            report_of([], claims=[{"kind": "image", "text": "`--full` has all.", "good": None}])
        )

    monkeypatch.setattr("airlight.reports.report.measure.write_report", write)
    return given


FAULTS = {
    "broken": "fog_of_mine.py, line 11: KeyError: 'nothing'",
    "flat": "returned an array of shape (3, 7) for",
    "hangs": "no answer within 45 s; its process was ended; AIRLIGHT_METHOD_LIMIT=90 allows more",
    "crashes": "ended its process, killed by SIGABRT",
    "exits": "SystemExit: 0",
    "darkens": "RuntimeError: too large",
}


@pytest.mark.slow
@pytest.mark.claim("own-method-process")
def test_a_report_goes_on_without_methods_that_are_at_fault(
    variant, mine, capfd, own_cache, monkeypatch
):
    import json

    monkeypatch.setenv("AIRLIGHT_METHOD_LIMIT", "45")
    own = [word for name in (*FAULTS, "half") for word in ("--method", f"fog_of_mine:{name}")]
    options = ["--quick", "open-fog", "--method", "unshadowed", "-o", "out"]
    assert run(["report", *options, *own, "--json"]) == 1
    printed = capfd.readouterr()
    data = json.loads(printed.out)["result"]
    rows = {row["method"].partition(":")[2]: row for row in data["scenes"][0]["methods"]}
    assert rows["half"]["error"]["relative_bias"] == pytest.approx(-0.5, abs=1e-5)
    page = (mine / "out" / "report.html").read_text(encoding="utf-8")
    for name, words in FAULTS.items():
        assert words in rows[name]["reason"]
        assert f"airlight: error: method fog_of_mine:{name}: " in printed.err
        assert f"method fog_of_mine:{name}: " in page
    # Those that are at fault in a small frame are told before the work, and
    # nothing of a fault is kept.
    assert printed.err.index("warning: method fog_of_mine:crashes") < printed.err.index(
        "error: method"
    )
    assert "warning: method fog_of_mine:darkens" not in printed.err
    assert (
        run(
            [
                "report",
                *options,
                "--method",
                "fog_of_mine:exits",
                "--method",
                "fog_of_mine:half",
                "--json",
            ]
        )
        == 1
    )
    again = {
        row["method"].partition(":")[2]: row
        for row in json.loads(capfd.readouterr().out)["result"]["scenes"][0]["methods"]
    }
    assert (again["exits"]["cached"], again["half"]["cached"]) == (False, True)


def _measured(handed_on):
    return [
        (each.method, each.kernel, dict(each.parameters)) for each in handed_on["configurations"]
    ]


@pytest.mark.claim("methods-are-named-alike")
def test_methods_and_parameters_are_those_of_render_and_bench(variant, handed_on):
    """One configuration of each method that is named, with the kernel and the
    parameters that are given.
    """
    assert run(["report", "open-fog", "--method", "ray-march", "--set", "steps=32"]) == 0
    assert handed_on["scenes"] == ("open-fog",)
    assert _measured(handed_on) == [("ray-march", None, {"steps": 32})]
    named = ["--method", "shadow-planes", "--method", "light-volumes", "--set", "kernel=taylor"]
    assert run(["report", "open-fog", *named, "--set", "points=8"]) == 0
    assert _measured(handed_on) == [
        ("shadow-planes", "taylor", {"points": 8}),
        ("light-volumes", "taylor", {"points": 8}),
    ]


@pytest.mark.claim("methods-are-named-alike")
def test_what_is_named_is_measured_alone_and_all_are_a_word(
    variant, mine, handed_on, capsys, monkeypatch
):
    from airlight.validation.study.configuration import QUICK

    # `tests/reports/machine/test_own_process.py` has the process that imports it.
    monkeypatch.setattr(
        "airlight.reports.machine.own_process.in_own_process",
        lambda work, *given, **how: work(*given),
    )
    assert run(["report", "--quick", "--method", "fog_of_mine:half"]) == 0
    assert [each[0] for each in _measured(handed_on)] == ["fog_of_mine:half"]
    assert (
        "note: what --method names is measured alone; --method all adds" in capsys.readouterr().err
    )
    assert run(["report", "--quick", "--method", "all", "--method", "fog_of_mine:half"]) == 0
    assert handed_on["configurations"][:-1] == QUICK
    assert handed_on["configurations"][-1].method == "fog_of_mine:half"
    assert capsys.readouterr().err == ""


def test_from_python_a_function_runs_in_this_process(variant, tmp_path, handed_on):
    import airlight

    report = airlight.report("open-fog", method=["min-max", brighter], output=tmp_path / "out")
    assert (report.folder, report.claims) == (tmp_path / "out", ("`--full` has all.",))
    assert [each[0].rpartition(":")[2] for each in _measured(handed_on)] == ["min-max", "brighter"]
    assert not handed_on["apart"]


@pytest.mark.claim("exit-status")
@pytest.mark.parametrize(("equivalent", "status"), [(True, 0), (None, 1), (False, 1)])
def test_a_report_ends_with_one_where_its_reference_is_not_confirmed(
    variant, monkeypatch, capsys, equivalent, status
):
    """Confirmed, not decided, contradicted; no method is at fault in any of them."""
    from tests.helpers.reports import agreement, entry, scene

    studied = scene(
        "fog", [entry("unshadowed (exact)")], agreement={"volpath airlight": agreement(equivalent)}
    )
    made = checked(report_of([studied]))
    monkeypatch.setattr(
        "airlight.reports.report.measure.write_report", lambda folder, study, **options: made
    )
    assert run(["report", "open-fog", "--method", "unshadowed"]) == status
    assert "error:" not in capsys.readouterr().err


@pytest.mark.parametrize("progress", [None, True])
def test_how_to_reproduce_a_report_is_what_made_it(variant, tmp_path, handed_on, progress):
    """Typed, called from Python by names, and with a function; never the arguments of
    the process that called.
    """
    import shlex

    import airlight

    asked = {
        "quick": True,
        "method": "ray-march",
        "settings": {"steps": 32},
        "output": tmp_path / "two words",
    }
    airlight.report("open-fog", progress=progress, **asked)
    words = [
        "report",
        "open-fog",
        "--method",
        "ray-march",
        "--set",
        "steps=32",
        "--quick",
        "--output",
    ]
    assert shlex.split(handed_on["command"]) == ["airlight", *words, str(tmp_path / "two words")]
    called, measured = handed_on["command"], _measured(handed_on)
    assert run(shlex.split(called)[1:]) == 0
    assert (handed_on["command"], _measured(handed_on)) == (called, measured)
    airlight.report("open-fog", method=["min-max", brighter], output=tmp_path, progress=progress)
    call = f"airlight.report(['open-fog'], method=['min-max', brighter], output={str(tmp_path)!r})"
    assert handed_on["command"] == call


def test_a_size_is_that_of_images_and_of_timed_frames(variant, images, handed_on, capsys):
    assert run(["report", "open-fog", "--method", "unshadowed", "--size", "96x72"]) == 0
    assert handed_on["study"].sizes == ((96, 72),)
    assert handed_on["study"].timed_size == (96, 72)
    assert handed_on["command"].endswith("--method unshadowed --size 96x72")
    assert run(["report", "--images", str(images), "--size", "96x72"]) == 2
    assert "images: they have sizes of their own; leave out size" in capsys.readouterr().err


@pytest.fixture
def images(tmp_path):
    folder = tmp_path / "engine"
    folder.mkdir()
    for name in ("open-fog.a.exr", "open-fog.b.exr", "omni-box.exr"):
        write_exr(folder / name, Image({"total": np.ones((6, 8, 3))}))
    return folder


def test_with_images_alone_their_scenes_are_studied(variant, images, handed_on):
    assert run(["report", "--quick", "--images", str(images)]) == 0
    assert sorted(handed_on["scenes"]) == ["omni-box", "open-fog"]
    labels = {
        name: [image.label for image in several] for name, several in handed_on["images"].items()
    }
    assert labels == {"omni-box": ["engine"], "open-fog": ["a", "b"]}
    assert run(["report", "--quick", "--images", str(images), "omni-box", "sphere-spot"]) == 0
    assert handed_on["scenes"] == ("omni-box", "sphere-spot")
    assert list(handed_on["images"]) == ["omni-box"]


def test_images_of_other_scenes_than_those_that_are_named_are_refused(
    variant, images, handed_on, capsys
):
    assert run(["report", "--quick", "--images", str(images), "sphere-spot", "hall"]) == 2
    assert (
        "has no image of hall, sphere-spot, only of omni-box, open-fog" in capsys.readouterr().err
    )
    assert not handed_on


def test_workers_of_a_cluster_are_handed_on_while_the_report_is_made(
    variant, tmp_path, handed_on, monkeypatch
):
    pytest.importorskip("distributed", reason="the extra `sweep` is not installed")
    open_places = []

    @contextmanager
    def connected(place):
        open_places.append(place)
        yield f"client of {place}"
        open_places.remove(place)

    monkeypatch.setattr("airlight.reports.cluster.connect.connected", connected)
    assert run(["report", "open-fog", "--cluster", "local:3", "-o", str(tmp_path / "r")]) == 0
    assert handed_on["cluster"] == "client of 3"
    assert open_places == []


@pytest.mark.claim("report-drawn-again")
def test_a_page_is_drawn_in_its_place_with_the_figures_that_are_asked_for(
    tmp_path, monkeypatch, capsys
):
    """`tests/reports/figures` draws them."""
    from tests.helpers.page import write_report_files

    folder, asked = write_report_files(tmp_path / "r"), []

    def write_figures(target, column, **chosen):
        asked.append((target, column, chosen))
        return (f"{target}/strip.pdf",)

    monkeypatch.setattr("airlight.reports.figures.report.write_figures", write_figures)
    data = (folder / "report.json").read_bytes()
    words = ["hall", "--figures", "single", "--method", "good (k)"]
    assert run(["report", "--from", str(folder / "report.json"), *words]) == 0
    assert asked == [(folder, "single", {"scene": "hall", "labels": ["good (k)"]})]
    printed = capsys.readouterr().out
    assert f"{folder}/report.html: 1 scene, drawn again\n{folder}/strip.pdf\n" in printed
    assert (folder / "report.json").read_bytes() == data
    assert "The reference is confirmed." in (folder / "report.html").read_text(encoding="utf-8")
    assert run(["report", "--from", str(folder), "hall", "fog", "--figures", "single"]) == 2
    assert "the strip shows one scene; name one of them" in capsys.readouterr().err
    assert run(["report", "--from", str(folder), "hall"]) == 2
    assert "from: the report is drawn again; leave out a scene" in capsys.readouterr().err


@pytest.mark.claim("report-drawn-again")
def test_a_report_in_a_notebook_has_its_claims_and_leads_to_its_page(tmp_path, monkeypatch):
    import airlight
    from tests.helpers.page import write_report_files

    report = airlight.report(from_=write_report_files(tmp_path / "r"))
    assert repr(report) == f"Report({str(tmp_path / 'r')!r}, 1 scenes)"
    shown = report._repr_html_()
    assert "<strong>Report on hall, 2026-11-21 12:34:56 +0000</strong>" in shown
    assert "<li>The reference is confirmed.</li>" in shown
    assert f'<a href="{(tmp_path / "r" / "report.html").as_uri()}">' in shown
    monkeypatch.chdir(tmp_path)
    # a notebook shows files below its folder alone
    assert '<a href="r/report.html">' in report._repr_html_()


@pytest.mark.claim("report-drawn-again")
def test_a_report_is_drawn_again_without_measuring(tmp_path, capsys):
    import json

    from airlight.reports.data.records import named_files, report_text
    from tests.helpers.page import report_data, small_report, write_report_files

    folder = write_report_files(tmp_path / "r")
    assert run(["report", "--from", str(folder), "-o", str(tmp_path / "again"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["result"] == json.loads(report_text(small_report()))
    assert "The reference is confirmed." in (tmp_path / "again" / "report.html").read_text(
        encoding="utf-8"
    )
    assert (
        json.loads((tmp_path / "again" / "report.json").read_text(encoding="utf-8"))
        == report_data()
    )
    (
        folder / next(name for name in named_files(small_report()) if name.endswith(".png"))
    ).write_bytes(b"half a file")
    assert run(["report", "--from", str(folder), "-o", str(tmp_path / "third")]) == 2
    assert "is no picture that can be read" in capsys.readouterr().err
