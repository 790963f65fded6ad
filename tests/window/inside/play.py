"""blender --enable-event-simulate -P play.py -- STORY: play the story of STORY.py."""

import importlib
import os
import sys

import bpy

sys.path.insert(0, os.getcwd())
bpy.context.preferences.view.show_splash = False
story = sys.argv[sys.argv.index("--") + 1]
importlib.import_module("hand").play(importlib.import_module(story).story)
