"""A bake that shows itself: colours come while it runs, follow the light, and go with Esc."""

import time

import bpy
from addon import install, part, settled, status
from colours import mean_difference, on_meshes
from hand import Until
from relight_story import open_scene

TURNS = 6


def story(hand, report):
    yield from install(report)
    yield from open_scene(hand)
    scene = bpy.context.scene
    scene.prt.resolution, scene.prt.method = "32", "agreement"
    yield Until("all is quiet", settled)
    yield from watch(hand, report, "first", turned=False)
    yield from watch(hand, report, "turned", turned=True)
    yield from escape(hand, report, "over a bake")
    bpy.ops.prt.clear()
    yield 0.5
    yield from escape(hand, report, "over nothing")


def watch(hand, report, step, turned):
    """Bake, look at every picture, and turn the light where asked; what was seen when."""
    scene, showing = bpy.context.scene, part("showing")
    scene.prt.name = step
    yield 0.3
    yield Until("all is quiet", settled)
    bpy.ops.prt.bake("INVOKE_DEFAULT", restart=True)
    start, seen, taken = time.perf_counter(), [], 0
    asked = []
    while status().running:
        if len(showing.delays) > taken:
            taken = len(showing.delays)
            _, _, known, error, draft = showing.delays[-1]
            seen.append((time.perf_counter() - start, known, error, draft, on_meshes()))
            if len(seen) in (1, 3):
                hand.picture(f"{step} {len(seen)}")
            if turned and not draft and len(asked) < TURNS:
                scene.prt.rotation += 0.3
                asked.append(taken)
        yield 0.01
    result = {"seconds": time.perf_counter() - start, "said": status().message}
    yield Until("the preview has settled", settled)
    hand.picture(f"{step} baked")
    final = on_meshes()
    result["pictures"] = [
        {
            "at": at,
            "known": known,
            "error": error,
            "draft": draft,
            "off": mean_difference(colours, final),
        }
        for at, known, error, draft, colours in seen
    ]
    result["delays"] = list(showing.delays)
    result["turns"] = sorted(part("work").turns)[-3:]
    report[step] = result


def escape(hand, report, step):
    """Esc while pictures are on the meshes: what is left of them."""
    scene, showing = bpy.context.scene, part("showing")
    before, slots = on_meshes(), materials()
    scene.prt.name = step
    yield 0.3
    bpy.ops.prt.bake("INVOKE_DEFAULT", restart=True)
    yield Until("colours are there", lambda: bool(showing.delays) or not status().running, 60)
    shown = on_meshes()
    yield from hand.to_view()
    hand.event("ESC", "PRESS")
    yield Until("it has stopped", lambda: not status().running, 60)
    hand.event("ESC", "RELEASE")
    yield Until("the preview has settled", settled)
    yield 0.5
    hand.picture(f"escaped {step}")
    after = on_meshes()
    same = set(before) == set(after) and all((before[n] == after[n]).all() for n in before)
    report[f"escaped {step}"] = {
        "shown": sorted(shown), "left": sorted(after), "same": same,
        "materials": slots == materials(), "said": status().message,
    }  # fmt: skip


def materials():
    return {
        item.name: [slot.material and slot.material.name for slot in item.material_slots]
        for item in bpy.context.scene.objects
    }
