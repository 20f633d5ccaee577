# SPDX-License-Identifier: BSD-3-Clause
"""What a sweep says, from its Parquet alone: claims with their intervals, figures, a page, a digest.

Read in this order:

- `read.py`: the Parquet by columns
- `samples.py`: one sample a scene for each configuration
- `claims.py`: shares of scenes within an error, with intervals
- `properties.py`: properties of scenes in words
- `correlations.py`: which property of a scene goes with error
- `worst.py`: the worst scenes of each configuration
- `faults.py`: refusals, and what is wrong whatever the error
- `summary.py`: all of these, worked out once
- `tables.py`: tables of them
- `figures.py`: figures of them
- `page.py`: the page
- `digest.py`: the digest in Markdown
- `write.py`: all files
"""
