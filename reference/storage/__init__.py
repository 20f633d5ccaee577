# SPDX-License-Identifier: BSD-3-Clause
"""Files: written whole or not at all, layered images, finished references
found again by their content.

Read in this order:

- `files.py`: writes a file whole or not at all;
- `exr.py`: reads and writes layered OpenEXR images;
- `cache.py`: keeps arrays on disk, within a limit;
- `build.py`: which airlight this is: version, commit, and a digest of all its files;
- `code.py`: a digest of the code and the data that compute a result;
- `store.py`: results by a frozen record of their inputs;
- `scene_digest.py`: a digest of everything in a scene.
"""
