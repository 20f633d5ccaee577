# SPDX-License-Identifier: BSD-3-Clause
"""Media: what fills space, and what it answers. Methods find lit intervals and ask
the medium for the rest.

**A new medium** is a frozen dataclass derived from `Medium` whose fields are opaque Dr.Jit arrays
(`dr.opaque`), `albedo` and `phase` among them. `rays` have an `origin` and a `direction`. A grey
medium that varies derives from `VaryingMedium`, which writes `channels`, `vacuum` and `length_of`,
and lets all suns in. A medium must write

- `channels` and `vacuum`: one extinction or three, and whether a ray can leave the medium without
  end; False where `part` gives every ray an end;
- `extinction(rays, x)`: at distances along rays, by channel;
- `optical_depth(rays, x0, x1)`: of segments, by channel, in closed form where it has
  one; x1 may be infinite;
- `longest(rays, light, x, change)`: a length from x on in which both depths and the logarithm of
  the extinction change by no more than a number together; an extinction that is linear between
  bends needs no share in it, even where it begins at 0;
- `bends(rays, light)`: where along rays the extinction or a depth has a kink, if it has any; a
  place that a ray never meets may be infinite or NaN;
- `length_of(depth)`: after which length no uniform step is needed; where it is infinite,
  `part(rays, x0, x1, *, uniform)` too: from where to where a ray has extinction, 0 and 0 where it
  has none. With `uniform` the part has an end even where x1 is infinite, such as after
  `OPTICAL_REACH` optical depths. `longest` and `bends` are asked for what `part` leaves;
- `thicker(factor)`: itself, with more extinction.

With these every method of lit intervals, the marchers, soft shafts, froxels, surfaces and user
methods render it, lit segments to 1e-6: `tests/realtime/scene/media/test_integrate.py` has a linear
density ramp. It may write, because it knows better,

- `summary`, in words for the user, and `phases` where it has several;
- `lit`: rays with a light, a class derived from `LitRays` with its own `airlight(x0, x1)`, a closed
  form or a kernel (`realtime.kernels` are those of the homogeneous medium), or its own `panel`,
  which shares work between nodes;
- `check_beam(axis, name)`: which lights at infinity it lets in, by an InputError for others; the
  axis is on the host, along the light;
- `depth_to_light`: of whole paths from points to a light;
- `rays`: what is found once for a ray, such as where it enters and leaves parts of the medium,
  for `Rays.crossed`;
- `source` and `unit`: what scatters, and its factor that is the same everywhere
  and is left out of integrals;
- `mean_source`, `last_depth`, `part`, `ambient`: of froxels, of steps, of a constant field.

`realtime.scene.read_media.read_medium` makes it from Mitsuba's medium; a medium that no file can
say is returned by a function put in its place. Point, spot and area lights have a
`position`; a light at infinity (`light.w == 0`) has an `axis`, its rays' direction. Its source is
not divided by r^2.

Read in this order:

- `medium.py`: the protocol, `Medium`, rays with one light, `LitRays`, and the homogeneous
  medium, which asks kernels;
- `integrate.py`: the airlight of lit segments, by panels, in any medium;
- `height_fog.py`: density by height: optical depths and suns in closed form;
- `density_grid.py`: density on a grid, marched;
- `bounded.py`: homogeneous media with bounds, in vacuum or in another; clouds;
- `facet_paths.py`: where the paths from a light to the points of a ray cross the planes of a convex
  medium;
- `light_paths.py`: how much of them lies in it, and how fast that changes along the ray;
- `bounded_rays.py`: their airlight: the bends of these paths, and how long panels may be.
"""
