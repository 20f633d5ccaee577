# SPDX-License-Identifier: BSD-3-Clause
"""Sequences of frames against the reference of each frame: flicker, lag, ghosts.

Read in this order:

- `frames_file.py`: what `frames.json` says of the frames of a renderer;
- `blocks.py`: regressions whose errors come from blocks of pixels that are left out in turn;
- `lag.py`: which filter in time makes the frames from the references;
- `measures.py`: every measure of a sequence, by mask;
- `judge.py`: the references of a scene's frames, the masks, and the sentence that is said.
"""
