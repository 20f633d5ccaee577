# SPDX-License-Identifier: BSD-3-Clause
"""Methods and kernels as a user names them, the timing of their frames, and their memory.

Read in this order:

- `kernel_names.py`: from a name such as 'quadrature-32' or 'module:function' to a kernel;
- `methods.py`: a configuration is a method with a kernel and parameters; the standard ones of commands and reports;
- `user_code.py`: the source code of a user's own method and kernel, for keys;
- `timing.py`: medians of frames and of their stages;
- `memory.py`: the peak of the memory while a frame is made.
"""
