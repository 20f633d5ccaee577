# SPDX-License-Identifier: BSD-3-Clause
"""The methods that a user names, checked: configurations with kernels and settings.

A user's method that is named, 'module:function' or 'file.py:function', is checked in a separate
process, which it may end or never leave. A function that Python gives is checked here.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError
from airlight.reports.api.inputs import configuration_of, kernel_name, several

if TYPE_CHECKING:
    from airlight.validation.study.configuration import Configuration

_KERNEL = "kernel="  # begins a setting that names a kernel


def checked_configuration(
    method: Any, kernel: Any = None, parameters: Any = None
) -> "tuple[Configuration, bool]":
    """Return a configuration, checked, and whether its code is a user's that is named.

    Such code is imported in a separate process, never here.
    """
    from airlight.realtime.methods.shader.source import is_shader
    from airlight.reports.machine.opengl import require_opengl
    from airlight.validation.study.configuration import Configuration, configuration

    # A configuration was checked when it was made.
    if isinstance(method, Configuration):
        return configuration_of(method, kernel, parameters), method.own
    # A GLSL file needs a driver, whose absence is a matter of the machine and has its own exit
    # status.
    if isinstance(method, str) and is_shader(method):
        require_opengl()
    # A colon separates module and name: only user code has one.
    apart = (isinstance(method, str) and ":" in method) or (
        isinstance(kernel, str) and ":" in kernel
    )
    if not apart:
        return configuration_of(method, kernel, parameters), False
    from airlight.reports.machine.own_process import in_own_process

    # An import may crash or never end, so that the process that checks user code is one that can be
    # ended.
    return in_own_process(
        configuration, method, kernel_name(kernel), parameters or {}, name=method
    ), True


def asked_configurations(
    methods: Any, kernels: Any, settings: Any, *, usual: Any = None
) -> "tuple[list[Configuration], bool]":
    """Return the configurations to measure, and whether all user code is named: it can
    then run in other processes.

    A method is a name, a function or a configuration. A name without kernel and settings stands for
    its standard configurations; 'all', the default, for `usual`, or those of every built-in method
    for fog. Every method is measured with each kernel and with all settings, given by name or as
    NAME=VALUE; kernel=NAME is one more kernel.
    """
    from airlight.realtime.methods.shader.source import is_users
    from airlight.validation.study.configuration import (
        Configuration,
        chosen_configurations,
        configuration,
        parse_settings,
    )

    # A word kernel=NAME is one more kernel; every other word is a setting.
    named_kernels = several(kernels)
    if isinstance(settings, Mapping):
        given = dict(settings)
    else:
        named_kernels += [
            word.removeprefix(_KERNEL) for word in several(settings) if word.startswith(_KERNEL)
        ]
        given = parse_settings([word for word in several(settings) if not word.startswith(_KERNEL)])
    option = "set" if given else "kernel" if named_kernels else ""
    # `apart` stays true as long as every method can be imported by its name in another process.
    chosen: list[Configuration] = []
    apart = True
    for method in several(methods) or ["all"]:
        if method == "all":
            # A kernel or a setting that only some of all methods know would be dropped in silence.
            if option:
                raise InputError(
                    f"{option}: got no single method that it is for; name methods by --method"
                )
            chosen += chosen_configurations() if usual is None else usual
        elif isinstance(method, Configuration):
            chosen.append(configuration_of(method, named_kernels, given))
        # A function of Python: it cannot be imported by name, so that it runs here.
        elif not isinstance(method, str):
            chosen += [
                configuration(method, kernel_name(kernel), given)
                for kernel in named_kernels or (None,)
            ]
            apart = False
        # A user's method, or a built-in one with settings: one configuration for each kernel.
        elif option or is_users(method):
            chosen += [checked_configuration(method, k, given)[0] for k in named_kernels or (None,)]
        else:
            chosen += chosen_configurations([method])
    # Two words may name one configuration, which is measured once. A kernel that is a function also
    # keeps all of it in this process.
    return list(dict.fromkeys(chosen)), apart and not any(
        callable(kernel) for kernel in named_kernels
    )
