# SPDX-License-Identifier: BSD-3-Clause
"""A verdict for every claim of the papers that are built here.

A row is data: the place in the paper, its words, its figure, the experiment that measures it and the rule of the
verdict. An experiment measures once for several rows and gives plain data. To add a row, add it to the rows of its
paper; no verdict is typed in.

Read in this order:

- `row.py`: a row, and the rule that makes its verdict
- `figures.py`: how rows take their figures from what was measured
- `equations.py`: the equations as printed against certified integrals
- `printed.py`: coefficients, phase functions, equations of clouds
- `droplets.py`: the droplets of clouds by Mie's theory
- `polynomials.py`: how good kernels of papers are on many rays
- `ordering.py`: the order of shadow planes and the stencil along a ray
- `extrusion.py`: silhouettes, the direction of their planes, light on surfaces
- `plain_laplacian.py`: the published filter of edges
- `tessellation.py`: meshes of light volumes, the filter, biased extrusion
- `pictures.py`: what shortcuts cost in images
- `scattering.py`: ambient fog against multiple scattering
- `motion.py`: what moves, and numbers of triangles
- `biri_tables.py`: the tables that rows of Biri need
- `ali_figures.py`: R1 to R4 of Ali 2016 and what goes with them
- `billeter_tables.py`: the figures and the table that rows of Billeter need
- `paper_images.py`: the pictures of the papers again
- `biri.py`: the rows of Biri, Arques, Michelin 2006
- `billeter.py`: the rows of Billeter, Sintorn, Assarsson 2010
- `bouthors.py`: the rows of Bouthors, Neyret, Max, Bruneton, Crassin 2008
- `ali.py`: the rows of Ali 2016
- `others.py`: the rows of other papers
- `catalogue.py`: all rows and experiments, and the judged rows of a run
"""
