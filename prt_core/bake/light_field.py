"""The capture of a surface light field: radiance of points in all directions, into NAME.slf.

Who renders is a camera: anything with `name`, `lights`, `most_points` of a block, and
`shoot(points, angles, samples, seed)`, such as Cycles with a shader for a camera, or the transport
of a bake. Where that takes long, `shoot_steps` does it little by little. Points are shot in blocks;
a block depends on nothing but its number and the settings, so that what was stopped goes on bit by
bit. A few points, the pilot, are shot first, with two seeds: they tell the noise, and whether a
light field that goes on is of the same scene, whatever of it has changed.
"""

import time
from dataclasses import asdict

import numpy as np

from prt_core.bake.field_denoise import (
    DENOISED,
    NOISY,
    RADIANCE,
    by_blocks,
    denoise_steps,
    keep_denoised,
)
from prt_core.bake.inputs import unless_begun
from prt_core.bake.light_field_load import KIND
from prt_core.bake.light_field_settings import (
    MOST_SAMPLES,
    PLANNED,
    LightFieldSettings,
    expect_share,
    planned_field,
)
from prt_core.bake.lights import cameras_attribute, keep_view_transform
from prt_core.errors import (
    expect,
    expect_flag,
    expect_kind,
    expect_named,
    expect_offers,
    system_errors,
)
from prt_core.lightfield.tangent_frames import smooth_frames
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.machine import expect_memory
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator
from prt_core.scene import Camera, Scene, expect_camera
from prt_core.scene.field_edges import field_edges
from prt_core.scene.field_points import field_points
from prt_core.store import begin_bake, check_scene, damage_as_error, finish_bake, write_scene
from prt_core.store.attributes import digest
from prt_core.version import __version__

# Seconds of a render where others wait between two, as a window does.
_RENDER = 1.0
# Paths of a block: some twenty seconds; and bytes of what it holds, at most.
_PATHS, _BLOCK_BYTES, _CHUNK_BYTES = 1 << 22, 1 << 28, 16 << 20
# Points of the pilot: so many at most, and at most this share of all.
_PILOT, _PILOT_SHARE = 64, 1 / 16
# Samples that a search for the tolerance begins with, and how fast it goes up at most.
_FIRST_SAMPLES, _STEP = 8, 8
# Where more of an object's rays miss it than this, it is said; and where it is an error.
_SOME_MISSED, _MOST_MISSED = 0.02, 0.5


def capture_light_field(
    scene,
    camera,
    path,
    settings=None,
    view=None,
    origin=None,
    restart=False,
    messages=(),
    pace=None,
    plan=False,
    share=None,
    cameras=None,
    view_transform=None,
):
    """Capture a light field into a store; a generator of `Progress` (see `runtime.progress.run`).

    What is there and unfinished is gone on with; what is finished and the same is left as it is.

    Parameters
    ----------
    scene : Scene
        Its receiving objects have the points: of their surfaces, or of the image, where it has one.
    camera : object
        Shoots: see this module.
    path : str or Path
        `NAME.slf`, a folder.
    settings : LightFieldSettings
    view : Camera, optional
        Kept for pictures.
    origin : dict of str -> str, optional
        Kept: the `file`, the `scene` and the `frame` it is of.
    restart : bool or "changed"
        Begin anew whatever is there, or only where that is of another scene or other settings; it
        stays until the new one is finished.
    messages : sequence of str
        Kept with its report.
    pace : float, optional
        Where it is given, renders take about a second each; by default a block is one. The bits
        are the same.
    plan : bool
        Only put the scene and the settings into the store, for those who capture shares.
    share : (int, int), optional
        (I, N): of a light field that was planned, only every N-th block from number I on. Several
        do so at once, on any machine; who captures without a share then closes it.
    cameras : dict of str -> Camera, optional
        Kept as well: all cameras of the scene by name.
    view_transform : ViewTransform, optional
        Kept as well: how pictures are shown.

    Returns
    -------
    dict
        The report: points, cells, lights, samples, noise, seconds, paths_per_second, bytes,
        missed, messages. Of a plan or a share only `blocks`: how many there are, or were captured.

    Raises
    ------
    PRTError
        The store belongs to another scene or other settings, or the camera did not see the points.
    """
    settings = LightFieldSettings() if settings is None else settings
    expect_kind("settings", settings, LightFieldSettings)
    expect_kind("scene", scene, Scene)
    expect_offers(
        "camera", camera, ("name", "lights", "most_points", "shoot"), "a camera of light fields"
    )
    path = expect_store_path("light field", path)
    if restart != "changed":
        expect_flag("restart", restart)
    share = expect_share(share)
    expect(
        not (expect_flag("plan", plan) and share) and (restart is False or not (plan or share)),
        "plan: one of plan, share and restart is asked for at a time",
    )
    expect(
        not settings.denoise or hasattr(camera, "denoise"),
        "denoise: the light of a bake has no noise; leave it out",
    )
    view = None if view is None else expect_camera(view)
    cameras = expect_named("cameras", cameras or {}, Camera, "cameras")
    points = points_of(scene)
    n_lights = max(len(camera.lights), 1)
    cells = settings.angles[0] * settings.angles[1]
    expect_memory(
        f"light field: {cells:,} directions of {n_lights} lights",
        12.0 * cells * (n_lights + 3),
        "take fewer angles, or leave out --lamps",
    )
    work = _Capture(scene, camera, settings, points, None if pace is None else _RENDER)
    with system_errors(path), unless_begun(path):
        kept = {"camera": view and view.to_dict(), "cameras": cameras_attribute(cameras)}
        given = kept, view_transform, origin, restart, list(messages), plan, share
        return (yield from work.steps(path, *given))


def points_of(scene):
    """The `FieldPoints` of a scene: of its receiving objects, or of its image where it has one.

    Raises
    ------
    PRTError
        No object of it receives.
    """
    if scene.image is not None:
        chosen = np.unique(scene.image.point)
    else:
        receives = np.array([item.receives for item in scene.objects], bool)
        owner = np.repeat(receives[scene.triangle_object], scene.lattice_sizes)
        chosen = np.union1d(scene.lattice[owner], scene.lattice_back[owner])
        chosen = chosen[chosen >= 0]
    expect(len(chosen), "objects: none of them has a face with an area; name others")
    # Neighbours have frames that are turned as little as can be: so their fields are alike.
    frames = smooth_frames(scene.points.normals[chosen], field_edges(scene, chosen))
    return field_points(scene, chosen, frames)


class _Capture:
    """One capture: its camera, points and settings, and seconds of a render."""

    def __init__(self, scene, camera, settings, points, seconds):
        self.scene, self.camera, self.settings, self.points = scene, camera, settings, points
        self.lights = tuple(camera.lights) or ("all",)
        self.cells = settings.angles[0] * settings.angles[1]
        self.a_render, self.seconds, self.paths = seconds, 0, 0

    def steps(self, path, kept, view_transform, origin, restart, messages, plan, share):
        settings, points = self.settings, self.points
        check_scene(self.scene)
        pilot = yield from self._pilot()
        samples = pilot["samples"]
        identity = {
            "kind": KIND,
            "scene": self.scene.fingerprint(),
            "camera": self.camera.name,
            "lights": list(self.lights),
            "look": pilot.pop("look"),
            **asdict(settings),
            "angles": list(settings.angles),
        }
        if share is not None:
            store = planned_field(path, identity)
            captured = 0 if store.is_complete else (yield from self._blocks(store, samples, share))
            return {"blocks": captured}
        store = begin_bake(path, identity, restart)
        if store.is_complete:
            if store.is_sound():
                keep_view_transform(store, view_transform, kept)
                with damage_as_error(path):
                    return finish_bake(store, path).attributes["report"]
            store.update(complete=False)
        resumed = "identity" in store.attributes
        if not resumed:
            store.update(identity=identity, kind=KIND, settings=asdict(settings))
        store.update(
            origin=origin or {}, lights=list(self.lights), **write_scene(store, self.scene)
        )
        keep_view_transform(store, view_transform, kept)
        store.keep("field_point", points.point)
        store.keep("field_frames", points.frames.astype(np.float32))
        if plan:
            *_, apart = self._arrays(store.create, samples)
            store.update(**{PLANNED: True})
            return {"blocks": len(apart)}
        yield from self._blocks(store, samples)
        *_, missed, apart = self._arrays(store.create, samples)
        missed, apart = missed.read(), apart.read().max()
        messages = [*messages, *self._missed_lines(missed), *(yield from self._dark_lines(store))]
        kept = None
        if settings.denoise:
            kept = yield from keep_denoised(store, self.lights, list(self._objects()), messages)
        if resumed:
            messages.append("the capture went on where others stopped: times are those since then")
        report = {
            "points": len(points), "cells": self.cells, "angles": list(settings.angles),
            "lights": list(self.lights), "camera": self.camera.name, **pilot,
            "seconds": self.seconds, "paths": self.paths,
            "paths_per_second": self.paths / self.seconds if self.seconds else None,
            "apart": float(apart), "missed": float(missed.mean()), "denoised": kept,
            "bytes": store.nbytes(), "messages": messages, "versions": {"prt_core": __version__},
        }  # fmt: skip
        store.seal(without=(PLANNED,), report=report)
        finish_bake(store, path)
        return report

    def _pilot(self):
        """A few points, with two seeds each time, until they agree well enough."""
        settings, n_points = self.settings, len(self.points)
        count = min(_PILOT, max(1, int(n_points * _PILOT_SHARE)))
        which = np.unique(np.linspace(0, n_points - 1, count).round().astype(int))
        some = self.points[which]
        samples = settings.samples or _FIRST_SAMPLES
        yield Progress("pilot", 0, 0)
        while True:
            halves = []
            for turn in range(2):
                shot, _ = yield from self._shoot(some, samples, "pilot", turn)
                halves.append(shot[0])
            one, two = (half.astype(np.float64) for half in halves)
            scale = np.sqrt(((one + two) ** 2).sum() / 2)
            noise = float(np.sqrt(((one - two) ** 2).sum()) / scale) if scale else 0.0
            yield Progress("pilot", 0, 0)
            met = noise <= settings.tolerance
            if settings.samples is not None or met or samples >= MOST_SAMPLES:
                break
            more = np.clip((noise / settings.tolerance) ** 2, 2, _STEP)
            samples = int(min(np.ceil(samples * more), MOST_SAMPLES))
        return {
            "samples": samples, "noise": noise,
            "tolerance_met": None if settings.samples else bool(met),
            "look": digest(*(np.ascontiguousarray(half) for half in halves)),
        }  # fmt: skip

    def _shoot(self, points, samples, what, number, first=0):
        """What the camera gives of points, and in how many seconds; a generator of `Progress`."""
        key = {"pilot": 0, "block": 1}[what], number
        seed = generator(self.settings.seed, Stage.LIGHT_FIELD, *key).integers(1 << 31)
        steps, seconds = self._camera_steps(points, self.settings.angles, samples, int(seed)), 0.0
        while True:
            start = time.perf_counter()
            try:
                step = next(steps)
            except StopIteration as end:
                shot = end.value
                break
            finally:
                seconds += time.perf_counter() - start
            if what == "pilot":
                yield Progress(what, number * step.total + step.done, 2 * step.total)
            else:
                done = first + len(points) * step.done // step.total
                yield Progress(KIND, done, len(self.points))
        missed = shot[1]
        expect(
            what == "block" or missed.mean() < _MOST_MISSED,
            f"light field: {missed.mean():.0%} of the rays met something else than their points; "
            "the surface is moved when it is rendered (true displacement, adaptive subdivision: "
            "apply them as modifiers), or something lies in the same place",
        )
        return shot, seconds

    def _camera_steps(self, *asked):
        if self.a_render is not None and hasattr(self.camera, "shoot_steps"):
            return (yield from self.camera.shoot_steps(*asked, seconds=self.a_render))
        return self.camera.shoot(*asked)

    def _block_size(self, samples):
        cells, n_lights = self.cells, len(self.lights)
        by_paths = _PATHS // (cells * samples)
        by_bytes = _BLOCK_BYTES // (12 * cells * (n_lights + 3))
        by_chunk = _CHUNK_BYTES // (12 * cells)
        most = self.camera.most_points
        return max(1, min(by_paths, by_bytes, by_chunk, most, len(self.points)))

    def _arrays(self, create, samples):
        """Those that blocks fill: the fields, which rays missed, how far points were apart."""
        n_points, size = len(self.points), self._block_size(samples)
        shape = len(self.lights), n_points, *self.settings.angles, 3
        chunks = 1, size, *self.settings.angles, 3
        names = (NOISY, DENOISED) if self.settings.denoise else (RADIANCE,)
        return [
            *(create(name, shape, "float32", chunks) for name in names),
            create("field_missed", (n_points,), "float32", (size,)),
            create("field_apart", (-(-n_points // size),), "float32", (1,)),
        ]

    def _blocks(self, store, samples, share=None):
        """Shoot what is not there yet, all or a share of it; returns how many blocks."""
        n_points, n_lights, count = len(self.points), len(self.lights), 0
        # Who captures a share finds them there.
        create = store.create if share is None else lambda name, *_: store.array(name)
        *fields, missed, apart = self._arrays(create, samples)
        size = self._block_size(samples)
        starts = range(0, n_points, size)
        for number, first in enumerate(starts):
            if share is not None and number % share[1] != share[0]:
                continue
            block = slice(first, min(first + size, n_points))
            yield Progress(KIND, first, n_points)
            if missed.holds(block) and apart.holds(number):
                if all(f.holds(n, block) for f in fields for n in range(n_lights)):
                    continue
            shot, seconds = yield from self._shoot(
                self.points[block], samples, "block", number, first
            )
            self.seconds += seconds
            self.paths += (block.stop - block.start) * self.cells * samples
            parts = [shot[0]]
            if self.settings.denoise:
                done = Progress(KIND, block.stop, n_points)
                some = self.points[block]
                parts.append((yield from denoise_steps(self.camera, shot[0], some, samples, done)))
            for field, part in zip(fields, parts, strict=True):
                field[:, block] = part
            apart[number : number + 1] = shot[2]
            missed[block] = shot[1]
            count += 1
        yield Progress(KIND, n_points, n_points)
        return count

    def _objects(self):
        """(name, rows of the field) of each object that has some."""
        owner = self.scene.points.object_index[self.points.point]
        for index in np.unique(owner):
            yield self.scene.objects[index].name, np.flatnonzero(owner == index)

    def _missed_lines(self, missed):
        for name, rows in self._objects():
            share = float(missed[rows].mean())
            if share > _SOME_MISSED:
                yield (
                    f"{name}: {share:.0%} of its rays met something else than their point; the "
                    "nearest direction that did meet it stands in"
                )

    def _dark_lines(self, store):
        """Lines on objects from which no light comes."""
        name = NOISY if self.settings.denoise else RADIANCE
        brightest = np.zeros(len(self.points))
        for block, values in by_blocks(store.array(name)):
            np.maximum(brightest[block], values.max(axis=(0, 2, 3, 4)), out=brightest[block])
            yield Progress("light", block.stop, len(self.points))
        return [
            f"{name}: its field is black: it has no material that reflects or emits, or no light "
            "reaches it"
            for name, rows in self._objects()
            if not brightest[rows].any()
        ]
