# SPDX-License-Identifier: BSD-3-Clause
"""The machine as commands use it: the Mitsuba variant, libLLVM, CUDA, processes, progress.

Read in this order:

- `process_start.py`: Ctrl-C and SIGTERM end a process at once; its standard streams can be written
- `progress.py`: progress bars with the time left
- `llvm.py`: finds a libLLVM that works
- `quick_compilation.py`: a hack, kernels that compile quickly and run slowly
- `opengl.py`: OpenGL, which draws shaders, and what to install.
- `driver_check.py`: the kernel `exact` in GLSL over certified integrals, which
  shows the errors of a driver.
- `gpu.py`: whether CUDA and OptiX work, and why not
- `mitsuba_log.py`: Mitsuba's warnings on the error stream, each once
- `environment.py`: chooses the variant; versions and processor
- `own_process.py`: the user's code, and kernels that compile quickly, in a separate process
- `own_program.py`: a program of others with a limit in time
- `engine_adapter.py`: the adapters of engines, which are such programs
- `doctor.py`: examines all of these
"""
