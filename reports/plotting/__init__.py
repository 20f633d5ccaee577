# SPDX-License-Identifier: BSD-3-Clause
"""How charts and pictures look.

`styles/` holds the style sheets of papers.

Read in this order:

- `style.py`: a colour and a marker for each method and kernel
- `pictures.py`: radiance and errors as 8-bit pictures
- `figure.py`: an empty figure, and how it becomes a file
"""
