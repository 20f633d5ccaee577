# SPDX-License-Identifier: BSD-3-Clause
"""One scene and what to study of it: its sizes, its configurations and its reference.

`scene_rows` measures the configurations, `scene_images` the images from elsewhere, and
`study_scene` puts all of it together.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import mitsuba as mi

from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import (
    ReferenceInputs,
    reference_image,
    reference_result,
)
from airlight.reference.storage.scene_digest import scene_content, scene_digest
from airlight.reference.storage.store import Kept
from airlight.validation.scenes.loading import LoadedScene, load_scene, resize, scene_identity
from airlight.validation.study.configuration import Configuration, has_idle_kernel
from airlight.validation.study.study import Cell, Study


@dataclass(frozen=True)
class SceneStudy:
    """One scene and what to study of it; properties that take time are computed on first use."""

    loaded: LoadedScene  #: at the size of the images
    study: Study  #: with one size of images
    machine: Mapping[str, str]  #: facts of the machine, on which times depend

    @cached_property
    def scene(self) -> Scene:
        """The scene as methods read it."""
        return read_scene(self.loaded.scene)

    @property
    def timed_size(self) -> tuple[int, int]:
        """The size of the frames that are timed [pixels]."""
        return self.study.measure.timed_size or self.size

    @cached_property
    def timed(self) -> Scene:
        """The scene at the size of the frames that are timed."""
        if self.timed_size == self.size:
            return self.scene
        with self.at(self.timed_size) as scene:
            return read_scene(scene)

    @cached_property
    def kept_reference(self) -> Kept[ReferenceImage]:
        """The quadrature reference at pixel centres, and what it took."""
        return reference_result(self.loaded.scene, self.reference_inputs)

    @property
    def reference(self) -> ReferenceImage:
        """The quadrature reference at pixel centres."""
        return self.kept_reference.value

    @cached_property
    def identity(self) -> str:
        """The identity of the scene, by its name."""
        if self.loaded.path is None:
            return scene_identity(self.name)
        return f"{self.name} {scene_digest(self.loaded.scene) or time.time_ns()}"

    @cached_property
    def configurations(self) -> tuple[Configuration, ...]:
        """The configurations to measure."""
        return configurations_for(self.scene, self.study.configurations)

    @property
    def name(self) -> str:
        """The name of a built-in scene, or the stem of the user's file."""
        return self.loaded.name

    @property
    def path(self) -> str:
        """The name of a built-in scene, or the path of the user's file."""
        return str(self.loaded.path or self.loaded.name)

    @property
    def size(self) -> tuple[int, int]:
        """The size of the images [pixels]."""
        return self.study.sizes[0]

    @contextmanager
    def at(self, size: tuple[int, int]) -> Iterator[mi.Scene]:
        """Give the scene another size [pixels] within a block: it is loaded once."""
        resize(self.loaded.scene, size, self.loaded.lens)
        try:
            yield self.loaded.scene
        finally:
            resize(self.loaded.scene, self.size, self.loaded.lens)

    def reference_of(self, pixel: str) -> ReferenceImage:
        """Return the quadrature reference at pixel centres, or its means over their
        areas: 'centre' or 'area'.
        """
        return (
            self.reference if pixel == "centre" else reference_image(self.loaded.scene, pixel=pixel)
        )

    def cell(self, chosen: Configuration) -> Cell:
        """Return the cell of a configuration."""
        return Cell(self.path, self.size, (), chosen, self.study.measure)

    @cached_property
    def reference_inputs(self) -> ReferenceInputs:
        """The inputs of the reference, which are among those of all that is compared with it."""
        return ReferenceInputs(scene_content(self.loaded.scene), points=self.study.points)

    def timed_cell(self, chosen: Configuration, scene: str) -> Cell:
        """Return the cell of a configuration at the size of timed frames;
        `scene`: its name or identity.
        """
        return replace(self.cell(chosen), scene=scene, size=self.timed_size)


def open_scene(name_or_path: str, study: Study, machine: Mapping[str, str]) -> SceneStudy:
    """Load a scene for a study, by its built-in name or by the path of its file."""
    return SceneStudy(load_scene(name_or_path, study.sizes[0]), study, machine)


def configurations_for(
    scene: Scene, configurations: Sequence[Configuration]
) -> tuple[Configuration, ...]:
    """Return the configurations that differ in this scene from the ones before them.

    Variants of the shadows are left out if nothing casts a shadow, and other kernels than `exact`
    if all lights are suns. The published treatment of
    bounded media is left out if the scene has none, or if they do not lie in vacuum, and so are
    light samples where there is no area light. Where nothing else is asked for, all stay.
    """
    # Names of parameters that change nothing here: a configuration that sets one of them renders
    # the same image as the configuration without it.
    without_effect = set() if scene.features.shadows else {"shadow", "order", "map"}
    without_effect |= set() if scene.medium.clear else {"media"}
    without_effect |= set() if scene.area_lights else {"points", "pattern"}
    kept = [
        each
        for each in configurations
        if not (without_effect & set(dict(each.parameters)) or has_idle_kernel(scene, each))
    ]
    return tuple(kept or configurations)
