# SPDX-License-Identifier: BSD-3-Clause
"""Studies: scenes x sizes x changes x configurations, what each combination
costs, and how wrong it is.

A *study* says which scenes, methods and sizes; a *cell* is one combination of them; a
*row* is what came of a cell.

Read in this order:

- `configuration.py`: a method with its kernel and parameters, by the names that a user gives;
- `settings.py`: what a study asks for, as its file and a report have it;
- `study.py`: a study from its TOML file, and its cells; those of ours are in `studies/`;
- `row.py`: what comes of a cell: the columns of a row, with unit and meaning;
- `frame_times.py`: a turn of a method: the times of a frame and of its stages;
- `turns.py`: the times of cells that are compared, of one run, in turns;
- `reference.py`: the reference that the cells of an image share;
- `stated_errors.py`: the errors that methods state for themselves;
- `run.py`: a cell is rendered and compared, and becomes a row;
- `scene.py`: one scene and what to study of it;
- `scene_rows.py`: the rows of its configurations, `scene_images.py`: those of images from elsewhere;
- `study_scene.py`: the study of one scene: reference, checks, rows, images;
- `keys.py`: what decides the numbers of a row, as a digest;
- `rows.py`: finished rows on disk, and their Parquet;
- `cost.py`: what a command will take, and the question before it starts;
- `causes.py`: the error of an image by its causes, which add up to it;
- `variation.py`: independent runs of methods that draw random numbers, and frames
  under a light that moves;
- `growth.py`: a scene with less and more of one kind of work, and the exponents with
  which times grow with it.
"""
