# SPDX-License-Identifier: BSD-3-Clause
"""Claim: kernels have names, a user's own too."""

import sys

import pytest

from analytic.errors import InputError
from realtime.errors import InputError as MethodError
from realtime.kernels.quadrature import quadrature
from realtime.kernels.registry import KERNELS
from validation.study.configuration import find_kernel, split_name


def test_number_behind_a_name_sets_the_first_parameter():
    kernel = find_kernel("quadrature-24")
    assert kernel.func is quadrature
    assert kernel.keywords == {"nodes": 24}
    assert find_kernel("taylor-6").keywords == {"degree": 6}
    # The longest name of the registry wins: 'quadrature-theta-8' is no 'quadrature' of size 'theta-8'.
    assert split_name("quadrature-theta-8") == (KERNELS["quadrature-theta"], 8)


@pytest.mark.parametrize("name", ["fog_kernel:kernel", "fog_kernel.py:kernel", "{folder}/fog_kernel.py:kernel"])
def test_a_users_kernel_is_found_in_the_current_folder_and_says_where_it_fails(tmp_path, monkeypatch, name):
    folder = tmp_path / "with: colon"
    folder.mkdir()
    (folder / "fog_kernel.py").write_text("from beside_it import two\n\n\ndef kernel(x):\n    return two / x\n")
    (folder / "beside_it.py").write_text("two = 2\n")
    monkeypatch.chdir(folder)
    for module in ("fog_kernel", "beside_it"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    kernel = find_kernel(name.format(folder=folder))
    assert kernel(2.0) == 1.0
    with pytest.raises(MethodError, match=r"^kernel .*fog_kernel\.py, line 5: ZeroDivisionError"):
        kernel(0.0)


@pytest.mark.parametrize(
    "name", ["gone:function", "realtime.kernels:gone", "realtime.kernels.:x", ":x", "realtime.kernels:", "math:pi"]
)
def test_what_is_no_kernel_is_refused_by_name(name):
    with pytest.raises(InputError, match=f"^kernel.*{name}"):
        find_kernel(name)


@pytest.mark.parametrize(
    "name", ["quadratur", "quadrature-", "quadrature-x", "quadrature-1.5", "-4", "", "quadrature--4"]
)
def test_other_names_are_refused(name):
    with pytest.raises(InputError, match="wanted one of exact"):
        find_kernel(name)
