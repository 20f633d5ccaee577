# SPDX-License-Identifier: BSD-3-Clause
"""The command line, the Python interface, the error report, figures and tables for papers.

Read in this order:

- `machine/`: what works on this machine, the Mitsuba variant, progress bars;
- `data/`: report.json: its schema, writing and reading;
- `plotting/`: the style of charts, colour maps, pictures;
- `tables/`: tables as data, and how they are drawn;
- `interchange/`: descriptions of scenes for other renderers, glTF;
- `engines/`: the report on engines of others: its data, judgements and page;
- `diff/`: the comparison of two reports;
- `page/`: the page of a report;
- `figures/`: figures of a report and of the papers;
- `report/`: measures what a report asks for and writes it;
- `api/`: the functions of `import airlight` and their results;
- `studies/`: `airlight study NAME`: a function each, with tables and a figure;
- `view/`: the live view in the browser;
- `cluster/`: cells and references by the workers of a Dask cluster;
- `sweep/`: what a sweep says, from its Parquet;
- `kit/`: certified rays and scenes for other languages and renderers;
- `challenge/`: unseen scenes of a seed, and one number for an entry;
- `commands/`: the command line, made of these functions.
"""
