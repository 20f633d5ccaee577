# SPDX-License-Identifier: BSD-3-Clause
"""OpenGL, which draws the shaders of users: whether it is there, whether it is
right, and what to install.
"""

from functools import cache

from airlight.realtime.errors import NoDriverError
from airlight.realtime.methods.shader.client import ShaderHost
from airlight.reports.machine.environment import MissingError, require
from airlight.reports.machine.gpu import Status

_DEBIAN = "apt-get install -y libegl1 libgl1 libgl1-mesa-dri"


def opengl_status(*, judged: bool = True) -> Status:
    """Start OpenGL in a separate process; return its device, version and error on certified
    integrals, or what to do.

    The error is measured once for each device. Without `judged`, for machines that cannot
    import Mitsuba, it is not.
    """
    host = ShaderHost("OpenGL")
    try:
        # An empty list of stages starts OpenGL and draws nothing.
        said, _ = host.ask("open", stages=[])
        device = f"{said['device']}, {said['version']}"
        if not judged:
            return Status(True, device)
        from airlight.realtime.export.text import CONFORMING
        from airlight.reports.machine.driver_check import error_of_device

        wrong = error_of_device(device, host=host)
    except NoDriverError as error:
        return Status(False, str(missing(str(error))))
    finally:
        host.end()
    words = f"{device}: the kernel `exact` errs by {wrong:.1e} at most on certified integrals"
    # `not <=` also refuses an error that is not a number.
    if not wrong <= CONFORMING:
        return Status(
            False,
            f"{words}, more than {CONFORMING:g}; LIBGL_ALWAYS_SOFTWARE=1 draws on the processor",
        )
    return Status(True, words)


@cache
def require_opengl() -> str:
    """Return the device that draws shaders, with its error; raise MissingError if none
    does, or if it is wrong.
    """
    require("moderngl", "shaders", "a shader")
    status = opengl_status()
    if not status.works:
        raise MissingError(status.reason)
    return status.reason


def missing(why: str) -> MissingError:
    """Return the exception for a machine without OpenGL: `why` is what the host of shaders says."""
    if "moderngl" in why:
        return MissingError(
            "shaders need the package moderngl: `./airlight` brings it in a clone, `pip install "
            "moderngl` elsewhere"
        )
    return MissingError(
        f"shaders need OpenGL 4.3, and it does not start ({why}); on Debian: `{_DEBIAN}`; macOS "
        "ends at OpenGL 4.1"
    )
