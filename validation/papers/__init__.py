# SPDX-License-Identifier: BSD-3-Clause
"""The results of papers measured again, beside the published figures.

Read in this order:

- `biri.py`: Tables 1 and 2 of Biri, Arques, Michelin 2006;
- `constant_distance.py`: how wrong the constant R of their section 4.2 is, by size and depth;
- `billeter_images.py`: Figures 6 and 7 of Billeter, Sintorn, Assarsson 2010;
- `billeter_tessellation.py`: their Table 1;
- `ali.py`: the figures of Ali 2016 that captions describe;
- `bouthors.py`: what a slab decides of Bouthors, Neyret, Max, Bruneton, Crassin 2008;
- `bouthors_transport.py`: their Fig. 8, light by direction;
- `bouthors_clouds.py`: their Figs 11 and 12, and the error by order of scattering;
- `bouthors_frames.py`: their section 9, frames a second.
"""
