"""The window is closed in the midst of a bake: the story ends, and with it Blender."""

import bpy
from addon import install, status
from hand import FOLDER, Until


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "quit.blend"), load_ui=False)
    yield 0.5
    bpy.context.scene.prt.name = "quit"
    yield from hand.to_view()
    yield from hand.key("N")
    yield Until("the sidebar is there", lambda: hand.sidebar.width > 100)
    hand.sidebar.active_panel_category = "PRT"
    hand.view.tag_redraw()
    yield 0.5
    yield from hand.click("prt.bake")
    yield Until("it is in the midst", lambda: status().stage == "visibility", 60)
    report["running"] = status().running
