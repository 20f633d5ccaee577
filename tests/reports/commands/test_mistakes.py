# SPDX-License-Identifier: BSD-3-Clause
"""A mistake in a command ends with status 2 and one line that names the culprit; nothing is printed or written."""

import shlex

import numpy as np
import pytest

from reference.storage.exr import Image, write_exr
from reports.commands.main import WRONG_INPUT, run

#: A line as one types it, and what its one line says: the culprit, and where there is one the nearest name.
MISTAKES = (
    ("rendr", "'render'"),
    ("render", "SCENE"),
    ("--variant llvm_rgb doctor", "llvm_ad_rgb"),
    ("render open-fog --frames 3", "--frames: got no place"),
    ("render open-fog --samples 3 --frames 3 -o x.exr", "--samples: got --frames too"),
    ("render open-fog --size 8x6 --frames 3 --animate lamp -o x.exr", "--animate: got 'lamp'"),
    ("render open-fog --size 8x6 --frames 3 --animate objects -o x.exr", "no closed mesh that could turn"),
    ("render open-fog --method unshadowed --method ray-march", "--method: got unshadowed and ray-march"),
    ("render open-fog -o frame.png", "--output: got 'frame.png', wanted a name that ends in .exr"),
    ("render open-fog --change medium.sigma=1", "did you mean 'medium.sigma_t'"),
    ("view colonade", "did you mean 'colonnade'"),
    ("view sphere-spot --method shadow-plains", "did you mean 'shadow-planes'"),
    ("view sphere-spot --set tolerence=1", "did you mean 'tolerance'"),
    ("view sphere-spot --size huge", "wanted WIDTHxHEIGHT"),
    ("view sphere-spot --port 70000", "65535"),
    ("reference open-fog -o a.exr --estimator volpath --spp 128 --time-budget 3", "--spp and --time-budget exclude"),
    ("reference open-fog -o a.exr --estimator volpath --target-error 0", "--target-error: got 0"),
    ("reference open-fog -o a.exr --estimator volpath --pixel area", "volpath traces pixel centres"),
    ("reference open-fog -o a.exr --estimator volpath --seed 1048570 --spp 64 --size 8x6", "seed: got 1048570"),
    ("reference open-fog -o a.exr --spp 128", "--spp is for an estimator that samples"),
    ("reference open-fog -o a.exr --orders 1,2-inf", "--orders"),
    ("compare image.exr", "got 1 file"),
    ("compare image.exr open-fog", "the scene stands first: airlight compare open-fog"),
    ("compare opn-fog image.exr", "did you mean 'open-fog'"),
    ("compare image.exr image.exr --pixel area", "this option goes with a scene"),
    ("compare image.exr image.exr --exposure 1", "an exposure is for"),
    ("compare image.exr image.exr --margin 0", "margin: got 0.0"),
    ("compare image.exr image.exr --layer nothing --difference d.exr", "has no layer 'nothing'"),
    ("compare image.exr image.exr --diagnose", "--diagnose: it goes with a scene"),
    ("fit image.exr --scene open-fog --parameters sigmat", "did you mean"),
    ("fit image.exr --scene open-fog --parameters sigma_t --start sigma_t", "wanted NAME=VALUE"),
    ("merge image.exr image.exr -o m.exr", "image.exr"),
    ("describe open-frog", "did you mean 'open-fog'"),
    ("describe open-fog --gltf fog.gltf", "wanted a name that ends in .glb"),
    ("integrate rays.csv --phase mie:51", "2 to 50 um"),
    ("integrate rays.csv --phase tabulated", "without a table"),
    ("slab --sun 30 --tau -1", "wanted a thickness"),
    ("slab --sun 30 --tau 2 --photons 1000000000000", "--force"),
    ("clouds", "--tables"),
    ("clouds --tables --phase hg:0.5 --albedo 1.2", "albedo"),
    ("maps omni-box --sizes 12", "map: got 12, wanted a power of two"),
    ("maps omni-box --set map=64", "--set: got map=64, wanted it in --sizes"),
    ("bench --kernels --decompose", "got --kernels and --decompose"),
    ("bench hall --kernels", "bench --kernels: got a scene, which is for bench and bench --estimators"),
    ("bench --against x.json", "bench: got --against, which is for bench --scaling"),
    ("bench --no-truth --margin 0.1", "got --no-truth and --margin"),
    ("bench open-fog --scaling media", "0 bounded media"),
    ("bench open-fog --method froxel-fog --set slice=9", "did you mean 'slices'"),
    ("report --quick --full", "both --quick and --full"),
    ("report --quick hal", "did you mean 'hall'"),
    ("report --quick open-fog --set steps=3", "--set: got no single method"),
    ("report open-fog --method ray-march --set step=3", "did you mean 'steps'"),
    ("report open-fog --method mine.py:missing", "has no 'missing'"),
    ("report --images none", "wanted a folder with EXR files"),
    ("report --images engine", "names no scene"),
    ("report --from r --force", "--force"),
    ("report --from r", "r/report.json"),
    ("diff r r", "r/report.json"),
    ("paper billetter", "did you mean 'billeter'"),
    ("figures froxel", "figure: got 'froxel'"),
    ("figures strip --report none", "none/report.json"),
    ("sweep none.toml", "there is no file none.toml"),
    ("sweep --random 3 --cluster tcp:", "--cluster: got 'tcp:'"),
    ("sweep --markdown", "name its folder by --from DIR"),
    ("sweep --from r --random 3", "got --from together with --random"),
    ("sweep --from r --json --markdown", "got both --json and --markdown"),
)


@pytest.mark.claim("exit-status")
@pytest.mark.parametrize(("line", "culprit"), MISTAKES, ids=[line for line, _ in MISTAKES])
def test_a_mistake_is_one_line_that_names_the_culprit(variant, tmp_path, monkeypatch, capsys, own_cache, line, culprit):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rays.csv").write_text("t,h,x0,x1,sigma_t,value\n1,0.5,0,3,0.2,7\n")
    (tmp_path / "mine.py").write_text("def half(view):\n    return 1.0\n")
    ones = np.ones((6, 8, 3))
    image = Image({"airlight": ones, "airlight_se": 0.1 * ones}, attributes={"airlight:batches": 32})
    write_exr(tmp_path / "image.exr", image)
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
        path for path in sorted(tmp_path.rglob("*")) if own_cache not in path.parents and path != own_cache
    ] == before
