# SPDX-License-Identifier: BSD-3-Clause
"""The challenge: scenes drawn after an entry is named, and one number that a paper can cite.

Read in this order:

- `seed.py`: the seed, made of the words of an entry or given;
- `draw.py`: a seed to 24 scenes of three kinds;
- `folder.py`: challenge.json, its digest, and the files that `new` writes;
- `number.py`: the number, its floor and its interval;
- `record.py`: the content of score.json;
- `entry.py`: the folder of an entry, as its authors made it;
- `score.py`: the images of an entry judged;
- `board.py`: scored entries side by side, ties, and the page.
"""
