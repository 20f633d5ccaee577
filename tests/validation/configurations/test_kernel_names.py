# SPDX-License-Identifier: BSD-3-Clause
import pytest

from analytic.errors import InputError
from realtime.kernels.quadrature import quadrature
from realtime.kernels.registry import KERNELS
from validation.configurations.kernel_names import find_kernel, sized, split_name


def test_names_of_the_registry_are_their_functions():
    for name, record in KERNELS.items():
        assert find_kernel(name) is record.function


def test_number_behind_a_name_sets_the_first_parameter():
    kernel = find_kernel("quadrature-24")
    assert kernel.func is quadrature
    assert kernel.keywords == {"nodes": 24}
    assert find_kernel("taylor-6").keywords == {"degree": 6}
    # The longest name of the registry wins: 'quadrature-theta-8' is no 'quadrature' of size 'theta-8'.
    assert split_name("quadrature-theta-8") == (KERNELS["quadrature-theta"], 8)


def test_names_and_sizes_go_both_ways():
    for name in ("quadrature", "quadrature-12"):
        record, size = split_name(name)
        assert sized(record.name, size) == name


def test_function_of_ones_own_is_imported():
    assert find_kernel("realtime.kernels.quadrature:quadrature") is quadrature


@pytest.mark.parametrize(
    "name", ["quadratur", "quadrature-", "quadrature-x", "quadrature-1.5", "-4", "", "quadrature--4"]
)
def test_other_names_are_refused(name):
    with pytest.raises(InputError, match="wanted one of exact"):
        find_kernel(name)


def test_size_of_a_kernel_without_parameters_is_refused():
    with pytest.raises(InputError, match="'exact' has no parameter"):
        find_kernel("exact-16")
