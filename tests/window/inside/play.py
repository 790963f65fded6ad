"""blender --enable-event-simulate -P play.py -- STORY: play the story of STORY.py.

STORY may be MODULE:FUNCTION, where a module has several.
"""

import importlib
import os
import sys

import bpy

sys.path.insert(0, os.getcwd())
bpy.context.preferences.view.show_splash = False
module, _, function = sys.argv[sys.argv.index("--") + 1].partition(":")
importlib.import_module("hand").play(getattr(importlib.import_module(module), function or "story"))
