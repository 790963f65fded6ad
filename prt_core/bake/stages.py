"""Stages of a bake that are cut into blocks of work, and what says which of them are done.

A block is done where the parts of the arrays that it fills are whole; so it may be computed by
anybody, in any order, and more than once. Only who plans and finishes the bake, one process at a
time, writes its attributes: which stages there are stands in the attribute "work" while the bake is
not finished. Beside each block stands what it took, in an array that goes with the attribute.
"""

import re
from dataclasses import dataclass

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.store import damage_as_error

# What a block notes of itself: seconds, rays, and rays that met too many surfaces that let light
# pass (see `PassingCaster`).
FIGURES = ("seconds", "rays", "too_deep")
_NAME, _MOST_BLOCKS = re.compile("(visibility[123]?|gather[0-9]{1,2})"), 1 << 31
# Stages that are open, their settings, and what only who planned the bake knew.
WORK = "work"
# Arrays that go with that attribute: from which points nothing can be in the way, and the lights
# of the certificate.
OPEN, LIGHTS = WORK_ARRAYS = "work_open", "work_lights"


@dataclass(frozen=True)
class Stage:
    """Work that is cut into blocks.

    Attributes
    ----------
    name : str
    blocks : int
        How many there are; their indices are 0 to `blocks` - 1.
    """

    name: str
    blocks: int


class BlocksMissing(PRTError):
    """Blocks of a stage are not there yet; everything before them is.

    Attributes
    ----------
    path : Path
        Of the bake.
    stage : str
    blocks : list of int
        Ascending.
    """

    exit_code = 3

    def __init__(self, path, stage, blocks):
        self.path, self.stage, self.blocks = path, stage, list(blocks)
        ranges = ranges_text(self.blocks)
        count = f"{len(self.blocks):,} block{'s' * (len(self.blocks) > 1)}"
        super().__init__(
            f"{path}: {count} of stage '{stage}' missing ({ranges}); run 'prt bake-blocks {path} "
            f"--stage {stage} --blocks {ranges}', then 'prt bake --finish {path}'"
        )

    def __reduce__(self):
        return type(self), (self.path, self.stage, self.blocks)


def ranges_text(blocks):
    """Ascending whole numbers as text: "0-3,7"."""
    blocks = np.asarray(blocks, np.int64)
    parts = np.split(blocks, np.flatnonzero(np.diff(blocks) != 1) + 1) if len(blocks) else []
    return ",".join(str(p[0]) if len(p) == 1 else f"{p[0]}-{p[-1]}" for p in parts)


def is_planned(store):
    """Whether blocks of this bake may be computed apart."""
    return WORK in store.attributes


def open_stages(store):
    """The stages of a planned bake that are known by now, in order: list of `Stage`.

    Raises
    ------
    PRTError
        What is said of them is damaged.
    """
    with damage_as_error(store.path, "its plan"):
        stages = [Stage(name, blocks) for name, blocks in store.attributes[WORK]["stages"]]
        good = all(
            isinstance(each.name, str)
            and _NAME.fullmatch(each.name)
            and type(each.blocks) is int
            and 0 < each.blocks <= _MOST_BLOCKS
            for each in stages
        )
        expect(good, "its stages are named otherwise than by this library")
        return stages


def open_stage(store, name, n_blocks, **more):
    """Let blocks of a stage be computed apart; `more` is put into the attribute "work".

    Where the bake is not planned, nothing is done.
    """
    if not is_planned(store):
        return
    store.create(_figures(name), (n_blocks, len(FIGURES)), "float64", (1, len(FIGURES)))
    work = store.attributes[WORK]
    # One that is opened again, for damaged blocks, keeps its place.
    stages = dict(work["stages"]) | {name: n_blocks}
    store.update(**{WORK: {**work, **more, "stages": [list(stage) for stage in stages.items()]}})


def note_figures(store, name, index, figures):
    """Write what a block took, (seconds, rays, too_deep), beside it."""
    store.array(_figures(name))[index] = np.array(figures, np.float64)


def read_figures(store, name, blocks):
    """(n, 3) float64: what blocks of a range took, as far as it is known; else 0."""
    result = np.zeros((len(blocks), len(FIGURES)))
    try:
        array = store.array(_figures(name))
    except PRTError:
        return result
    for row, index in enumerate(blocks):
        if index < len(array) and array.holds(index):
            result[row] = array[index]
    return result


def sum_work(store, seconds):
    """Add up what blocks took; the seconds of each stage are added to `seconds`.

    Returns
    -------
    too_deep : int
        Rays that met too many surfaces that let light pass.
    names : list of str
        Arrays that go when the bake is finished.
    """
    too_deep, names = 0, list(WORK_ARRAYS)
    for stage in open_stages(store):
        figures = read_figures(store, stage.name, range(stage.blocks)).sum(axis=0)
        name = stage.name.rstrip("0123456789")
        seconds[name] = seconds.get(name, 0.0) + float(figures[0])
        too_deep += int(figures[2])
        names.append(_figures(stage.name))
    return too_deep, names


def _figures(name):
    return f"work_{name}"
