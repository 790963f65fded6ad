"""An object is moved after the bake: one button bakes what that changes, or a selection of it."""

import bpy
from addon import install, part, settled, status
from colours import on_meshes, relative_l2
from hand import Until
from relight_story import compare, open_scene


def story(hand, report):
    report["light"] = {}
    yield from install(report)
    yield from open_scene(hand)
    scene = bpy.context.scene
    scene.prt.method = "agreement"
    yield Until("all is quiet", settled)
    yield from bake(hand, report, "prt.bake", "before")
    # Moved as a person does: G, X, a number, Enter, with the mouse over the view.
    yield from move(hand, "X", "0.4")
    yield Until("the panel says so", lambda: part("moving").has_changed(scene), 30)
    yield 0.5
    hand.picture("moved")
    report["warned"] = part("preview").held(scene).warned
    yield from bake(hand, report, "prt.update", "updated")
    updated = on_meshes()
    report["offered after"] = part("moving").has_changed(scene)
    bpy.ops.prt.bake("INVOKE_DEFAULT", restart=True)
    yield from until_baked(hand, report, "whole")
    report["off"] = relative_l2(updated, on_meshes())
    yield from selection(hand, report)


def move(hand, axis, by):
    yield from hand.to_view()
    yield from hand.key("G")
    yield from hand.key(axis)
    yield from hand.type(by)
    yield from hand.key("RET")
    yield 0.3


def bake(hand, report, button, step):
    yield from hand.click(button)
    yield Until("it has begun", lambda: status().running, 10)
    yield from until_baked(hand, report, step)


def until_baked(hand, report, step):
    yield Until("it is done", lambda: not status().running, 240)
    said = status().message
    yield from compare(hand, report, step)
    report[f"said {step}"] = said


def selection(hand, report):
    """The model goes back; the model alone is baked: the ground keeps its colours."""
    scene, before = bpy.context.scene, (yield from under_the_sky())
    yield from move(hand, "X", "-0.4")
    yield Until("the panel says so", lambda: part("moving").has_changed(scene), 30)
    scene.prt.selection_only = True
    yield 0.5
    yield from bake(hand, report, "prt.update", "selected")
    after = yield from under_the_sky()
    report["kept"] = {
        name: relative_l2({name: after[name]}, {name: before[name]}) for name in before
    }


def under_the_sky():
    """Colours without lamps, whose shadows are cast at the moment."""
    prt = bpy.context.scene.prt
    prt.use_lamps = False
    yield Until("the preview has settled without lamps", settled)
    colours = on_meshes()
    prt.use_lamps = True
    yield Until("the preview has settled with lamps", settled)
    return colours
