# SPDX-License-Identifier: BSD-3-Clause
"""Filters of whole images: Gaussian, bilateral, joint bilateral, and up-sampling with a depth test.

An image is a Dr.Jit array with an entry per pixel, row by row. All filters have one form,

    g(p) = f(p) + sum_q w(p, q) (f(q) - f(p)) / sum_q w(p, q),
    w = exp(-|p - q|^2 / (2 hd^2) - sum_i |t_i(p) - t_i(q)|^2 / (2 hr_i^2)),

with the sums over pixels q of the image in the square of half side `support` hd about p. Of the guides t_i each has its
width hr_i: f itself for the bilateral filter, the logarithm of the depth or a normal for a joint one; the Gaussian has
none. As differences are summed, a constant image stays what it is to the bit.

Read in this order:

- `guides.py`: what says that two pixels are alike, and how it stays finite at the sky;
- `raster.py`: how pixels lie, and images with a margin;
- `bilateral.py`: the sum as it stands, pixel by pixel;
- `separable.py`: rows, then columns: the Gaussian exactly, the others nearly;
- `levels.py`: the bilateral filter of an image of few levels, exactly, as a sum of Gaussians;
- `tile_average.py`: the mean over a tile of 4 x 4 in which every pixel has another sample;
- `upsample.py`: from few pixels to many, with a depth test.
"""
