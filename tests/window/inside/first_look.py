"""When the colours of a bake under way come, and what they cost; figures into report.json.

The scene is scene.blend; bakes with pictures and without them take turns.
"""

import json
import time

import bpy
from addon import install, part, settled, status
from colours import mean_difference, on_meshes
from hand import FOLDER, Until

# Changes of the light during a bake, as fast as colours follow.
CHANGES = 20


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "scene.blend"), load_ui=False)
    bpy.context.preferences.system.viewport_aa = "OFF"
    yield 0.5
    yield from hand.to_view()
    yield from hand.key("N")
    yield Until("the sidebar is there", lambda: hand.sidebar.width > 100)
    hand.sidebar.active_panel_category = "PRT"
    hand.view.spaces.active.region_3d.view_perspective = "CAMERA"
    scene = bpy.context.scene
    scene.prt.light, scene.prt.studio = "STUDIO", "city.exr"
    yield 1.0
    mark, draws = marks(), drawn()
    report["embree"], report["blender"] = {"with": [], "without": []}, {"with": []}
    yield from bake(hand, report["blender"]["with"], (mark, draws), "blender", "with", whole=False)
    for kind in ("with", "without"):
        yield from bake(hand, report["embree"][kind], (mark, draws), "embree", kind)
    draws.clear()
    yield from turned(hand, report["embree"], "embree", draws)
    report["points"] = part("preview").held(scene).bake.transport.n_points


def marks():
    """A list of (what, wall, CPU seconds) to which the stages of a bake add themselves."""
    from prt_core.bake import pictures
    from prt_core.scene import Scene

    noted = []

    def note(what):
        noted.append((what, time.perf_counter(), time.process_time()))

    def after(owner, name, what):
        plain = getattr(owner, name)

        def noting(*arguments, **more):
            result = plain(*arguments, **more)
            note(what)
            return result

        setattr(owner, name, noting)

    build = Scene.from_meshes.__func__

    def from_meshes(cls, *arguments, **more):
        note("read")
        result = build(cls, *arguments, **more)
        note("built")
        return result

    Scene.from_meshes = classmethod(from_meshes)
    after(Scene, "make_caster", "caster")
    after(pictures.Pictures, "begin", "looked")
    after(part("preview"), "write", "written")
    return noted


def drawn():
    """A list to which each drawing of a 3D view adds its (wall, CPU) seconds."""
    spent, begun = [], []

    def begin():
        begun[:] = time.perf_counter(), time.process_time()

    def end():
        wall, cpu = begun
        spent.append((time.perf_counter() - wall, time.process_time() - cpu))

    for function, when in ((begin, "PRE_VIEW"), (end, "POST_PIXEL")):
        bpy.types.SpaceView3D.draw_handler_add(function, (), "WINDOW", when)
    return spent


def bake(hand, rows, noted, caster, kind, whole=True):
    """A bake, or its beginning: what was seen when, what it cost, and what differs at the end."""
    mark, draws = noted
    scene, showing = bpy.context.scene, part("showing")
    scene.prt.caster, scene.prt.name = caster, f"{caster}_{kind}"
    yield 0.5
    yield Until("all is quiet", settled, 300)
    begin = showing.begin
    if kind == "without":
        showing.begin = lambda scene: None
    mark.clear()
    draws.clear()
    start, cpu = time.perf_counter(), time.process_time()
    bpy.ops.prt.bake("INVOKE_DEFAULT", restart=True)
    seen, taken = [], 0
    while status().running:
        if kind == "with" and len(showing.delays) > taken:
            taken = len(showing.delays)
            seen.append((*showing.delays[-1], on_meshes()))
            status().cancel = not whole
        yield 0.01
    showing.begin = begin
    row = {"wall": time.perf_counter() - start, "cpu": time.process_time() - cpu}
    row["draws"] = list(draws)
    row["marks"] = [(what, wall - start, used - cpu) for what, wall, used in mark]
    yield Until("the preview has settled", settled, 300)
    final = on_meshes() if whole else None
    row["pictures"] = [
        [*more, mean_difference(colours, final) if whole else None] for *more, colours in seen
    ]
    row["said"] = status().message
    if kind == "with":
        hand.picture(f"{caster} baked")
    rows.append(row)
    print(json.dumps(row))


def turned(hand, report, caster, draws):
    """The light is turned all the time while a bake runs: how often colours follow."""
    scene, showing = bpy.context.scene, part("showing")
    scene.prt.name = f"{caster}_turned"
    yield 0.5
    yield Until("all is quiet", settled, 300)
    bpy.ops.prt.bake("INVOKE_DEFAULT", restart=True)
    yield Until("colours are there", lambda: bool(showing.delays), 120)
    taken, begun, cpu = len(showing.delays), time.perf_counter(), time.process_time()
    changes = 0
    draws.clear()
    while status().running and changes < CHANGES:
        count = len(showing.delays)
        scene.prt.rotation += 0.1
        while status().running and len(showing.delays) == count:
            yield 0.005
        changes += 1
    report["turned"] = {
        "changes": changes, "wall": time.perf_counter() - begun,
        "cpu": time.process_time() - cpu, "delays": showing.delays[taken:], "draws": list(draws),
    }  # fmt: skip
    hand.picture(f"{caster} turned")
    yield Until("it is done", lambda: not status().running, 900)
    yield Until("the preview has settled", settled, 300)
