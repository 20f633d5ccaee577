# SPDX-License-Identifier: BSD-3-Clause
"""Files: written whole or not at all, layered images, finished references found again by their content.

Read in this order:

- `files.py`: writes a file whole or not at all;
- `exr.py`: reads and writes layered OpenEXR images;
- `cache.py`: keeps arrays on disk, within a limit;
- `kept.py`: keys of results, by arguments and source code;
- `scene_digest.py`: a digest of everything in a scene.
"""
