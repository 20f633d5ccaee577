# SPDX-License-Identifier: BSD-3-Clause
"""OpenGL, which draws the shaders of users: whether it is there, and what to install."""

from dataclasses import dataclass

from realtime.errors import NoDriverError
from realtime.methods.shader.client import ShaderHost
from reports.machine.environment import MissingError

_DEBIAN = "apt-get install -y libegl1 libgl1 libgl1-mesa-dri"


@dataclass(frozen=True)
class OpenGl:
    """What draws shaders here."""

    works: bool
    device: str  #: its name; empty where there is none
    reason: str  #: its version, or why there is none and what to do


def opengl_status() -> OpenGl:
    """Start OpenGL in a process of its own."""
    host = ShaderHost("OpenGL")
    try:
        said, _ = host.ask("open", stages=[])
    except NoDriverError as error:
        return OpenGl(False, "", str(missing(str(error))))
    finally:
        host.end()
    return OpenGl(True, said["device"], said["version"])


def missing(why: str) -> MissingError:
    """Return the exception for a machine without OpenGL: `why` is what the host of shaders says."""
    if "moderngl" in why:
        return MissingError("shaders need the package moderngl: install it with `pip install '.[shaders]'` in a clone")
    return MissingError(
        f"shaders need OpenGL 4.3, and it does not start ({why}); on Debian: `{_DEBIAN}`; macOS ends at OpenGL 4.1"
    )
