# SPDX-License-Identifier: BSD-3-Clause
"""Files: written whole or not at all, layered images, finished references found again by their content.

Read in this order:

- `stopping.py`: what a process that a signal ends removes and says;
- `files.py`: writes a file whole or not at all;
- `exr.py`: reads and writes layered OpenEXR images;
- `scene_digest.py`: a digest of everything that decides the numbers of a reference;
- `cache.py`: keeps finished references on disk;
- `cache_size.py`: the size of the cache, its limit, and what is dropped.
"""
