# SPDX-License-Identifier: BSD-3-Clause
"""Renders of chance, and sequences of frames, against references without noise:
noise, flicker, lag, ghosts.

Read in this order:

- `noise.py`: independent renders of one frame: bias apart from noise;
- `frames_file.py`: what `frames.json` says of the frames of a renderer;
- `blocks.py`: regressions whose errors come from blocks of pixels that are left out in turn;
- `lag.py`: which filter in time makes the frames from the references;
- `measures.py`: every measure of a sequence, by mask;
- `judge.py`: the references of a scene's frames, the masks, and the sentence that is said.
"""
