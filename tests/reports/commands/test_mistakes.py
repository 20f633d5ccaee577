# SPDX-License-Identifier: BSD-3-Clause
"""A mistake in a command ends with status 2 and one line that names the culprit;
nothing is printed or written.
"""

import shlex

import numpy as np
import pytest

from airlight.reference.storage.exr import Image, write_exr
from airlight.reports.commands.main import WRONG_INPUT, run

#: A line as one types it, and what its one line says: the culprit, and where there
#: is one the nearest name.
MISTAKES = (
    ("rendr", 'Did you mean "render"'),
    ("render", "SCENE"),
    ("render open-fog --sampels 3", "Did you mean --samples"),
    ("render open-fog --frames 3", "frames: got no place"),
    ("render open-fog --samples 3 --frames 3 -o x.exr", "leave out samples"),
    ("compare open-fog a.exr --sequnce frames.json", "Did you mean --sequence"),
    # The name of before goes on working, and a file that is not there is named.
    ("compare open-fog a.exr --frames none.json", "none.json"),
    ("compare open-fog a.exr --frames=none.json", "none.json"),
    ("render open-fog --size 8x6 --frames 3 --animate lamp -o x.exr", "got 'lamp'"),
    (
        "render open-fog --size 8x6 --frames 3 --animate objects -o x.exr",
        "no closed mesh that could turn",
    ),
    ("render open-fog --method unshadowed --method ray-march", "--method"),
    ("render open-fog -o frame.jpg", "output: got 'frame.jpg', expected a name that ends in .exr"),
    ("render open-fog --method unshadowed --set kernel=tayler", "did you mean 'taylor'"),
    ("render open-fog --plan --timed", "plan: renders nothing"),
    (
        "render open-fog --size 8x6 --method unshadowed --run 3",
        "draws no random numbers; leave out run",
    ),
    ("render open-fog --change medium.sigma=1", "did you mean 'medium.sigma_t'"),
    ("view colonade", "did you mean 'colonnade'"),
    ("view sphere-spot --method shadow-plains", "did you mean 'shadow-planes'"),
    ("view sphere-spot --set pionts=1", "did you mean 'points'"),
    ("view sphere-spot --size huge", "expected WIDTHxHEIGHT"),
    ("view sphere-spot --address 127.0.0.1:70000", "65535"),
    (
        "reference open-fog --estimator volpath --samples 128 --seconds 3",
        "samples and seconds exclude",
    ),
    ("reference open-fog --estimator volpath --error 0", "error: got 0"),
    ("reference open-fog --estimator volpath --error 1.5", "expected less than 1"),
    ("reference open-fog --estimator volpath --seed -1 --samples 64 --size 8x6", "seed: got -1"),
    ("reference open-fog --estimator volpath --pixel area", "volpath traces pixel centres"),
    (
        "reference open-fog --estimator volpath --seed 1048570 --samples 64 --size 8x6",
        "seed: got 1048570",
    ),
    ("reference open-fog --samples 128", "quadrature: draws no samples; leave out samples"),
    ("reference open-fog --orders 1,2-inf", "orders"),
    ("reference open-fog --merge image.exr --merge image.exr -o m.exr", "image.exr"),
    ("reference open-fog --merge image.exr --samples 64", "merge: traces nothing"),
    ("reference open-fog --merge image.exr --estimator volpath", "leave out estimator"),
    ("reference open-fog --merge image.exr --size 8x6", "merge: traces nothing; leave out size"),
    ("reference open-fog --seed 3", "quadrature: draws no samples; leave out seed"),
    ("reference open-fog -o a.png", "expected a name that ends in .exr"),
    ("compare image.exr", "TEST"),
    ("compare image.exr empty.xml", "the scene stands first: airlight compare empty.xml image.exr"),
    ("describe empty.xml", "empty.xml: the file is empty"),
    ("reference image.exr", "the file is an EXR image"),
    ("render engine", "engine is a folder"),
    ("report --quick missing.xml", "there is no file missing.xml"),
    ("compare open-fog rays.csv", "rays.csv is not an EXR file"),
    ("compare image.exr open-fog", "the scene stands first: airlight compare open-fog"),
    ("compare opn-fog image.exr", "did you mean 'open-fog'"),
    ("compare image.exr image.exr --pixel area", "two images have no scene; leave out pixel"),
    ("compare image.exr image.exr --margin 0", "margin: got 0.0"),
    ("compare image.exr image.exr --layer nothing -o d.exr", "has no layer 'nothing'"),
    ("compare image.exr image.exr --diagnose", "two images have no scene; leave out diagnose"),
    ("compare open-fog image.exr --layer total=fog", "expected airlight, surface or total"),
    (
        "compare open-fog image.exr --diagnose --all-metrics",
        "all pixels of one image; leave out all_metrics",
    ),
    (
        "compare open-fog runs/#.exr --diagnose",
        "runs/#.exr, which stands for several files; expected one image",
    ),
    (
        "compare open-fog runs/#.exr --fit sigma_t",
        "fit: got runs/#.exr, which stands for several files",
    ),
    ("compare open-fog image.exr --fit sigmat", "did you mean"),
    ("compare open-fog image.exr --fit sigma_t=", "expected NAME or NAME=VALUE"),
    ("compare smoke image.exr --fit sigma_t", "the medium is a density grid"),
    ("compare smoke image.exr --diagnose", "the medium is a density grid"),
    ("describe open-frog", "did you mean 'open-fog'"),
    ("render open-fog --plan --set steps=3 --run 3", "by no method; leave out run, steps"),
    ("describe open-fog -o a.glb -o b.glb", "a.glb and b.glb, expected one .glb file at most"),
    ("describe open-fog -o fog.gltf", "expected a name that ends in .glb or .pbrt or .vol"),
    ("study integrals rays.csv --phase mie:51", "--phase"),
    ("study slab --tau 2", "--tau"),
    ("study slab 0 30", "expected a thickness"),
    ("study slab 2 30 --photons 1000000000000", "AIRLIGHT_FORCE=1"),
    ("study slab 2 30 --albedo 1.2", "albedo"),
    ("study scaling open-fog --kinds triangles", "0 triangles"),
    ("study methods open-fog --method froxel-fog --set slice=9", "did you mean 'slices'"),
    ("study slabs", 'Did you mean "slab"'),
    ("report --quick --full", "quick: names the effort; leave out full"),
    ("report --quick hal", "did you mean 'hall'"),
    ("report --quick open-fog --set steps=3", "set: got no single method"),
    ("report open-fog --method ray-march --set step=3", "did you mean 'steps'"),
    ("report open-fog --method mine.py:missing", "has no 'missing'"),
    ("report --images none", "expected a folder with EXR files"),
    ("report --images engine", "names no scene"),
    ("report --from r --quick", "quick"),
    ("report --from r", "r/report.json"),
    ("diff r r", "r/report.json"),
    ("paper billetter", "did you mean 'billeter'"),
    ("sweep none.toml", "there is no file none.toml"),
    ("sweep 3 --cluster tcp:", "--cluster: got 'tcp:'"),
    ("sweep 3 --from r", "from: computes no cells; leave out the study"),
)


@pytest.mark.claim("exit-status")
@pytest.mark.parametrize(("line", "culprit"), MISTAKES, ids=[line for line, _ in MISTAKES])
def test_a_mistake_is_one_line_that_names_the_culprit(
    variant, tmp_path, monkeypatch, capsys, own_cache, line, culprit
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rays.csv").write_text("t,h,x0,x1,sigma_t,value\n1,0.5,0,3,0.2,7\n")
    (tmp_path / "mine.py").write_text("def half(view):\n    return 1.0\n")
    ones = np.ones((6, 8, 3))
    image = Image(
        {"airlight": ones, "airlight_se": 0.1 * ones}, attributes={"airlight:batches": 32}
    )
    write_exr(tmp_path / "image.exr", image)
    (tmp_path / "empty.xml").touch()
    (tmp_path / "engine").mkdir()
    write_exr(tmp_path / "engine" / "opn-fog.exr", image)
    before = sorted(tmp_path.rglob("*"))
    assert run(shlex.split(line)) == WRONG_INPUT
    printed = capsys.readouterr()  # not of the file descriptors, where LLVM may speak too
    assert printed.out == ""
    assert culprit in printed.err
    assert printed.err.count("\n") == 1
    assert printed.err.startswith("airlight: error: ")
    assert [
        path
        for path in sorted(tmp_path.rglob("*"))
        if own_cache not in path.parents and path != own_cache
    ] == before
