"""The extension: bake light transport, and relight it live as vertex colours.

It holds no mathematics: everything is done by `prt_core`. Where to look:
properties and light_properties (what is set), request (the light, as a value), operators, moving,
refining, keeping, exporting, web_page, lightmaps, occlusion, looking, light_sets, remedies (what is
done), buttons (what they share), panels and panel_… (what is drawn), plan (what a bake would be),
advice (what is to be known before), bakes (those on disk), naming and saving (what they are called,
and how they go with their file), preview (the one in memory and its colours), showing (colours
while a bake runs), freshness and shapes (whether it is of the scene), live (when all this is done
again), evaluated and own_changes (what has changed, and whose change it is), gloss (when the view
moves), rendering (whether something renders), history (files and undo steps), work (long work
without a stuck window), idle_work (short work of a timer), views, studio and reflections (Blender's
shading, lights, and what EEVEE reflects). Light fields likewise:
field_operators, field_panel, field_list (those on disk), light_fields (the one in memory),
following (when it is shown again), viewport (from where).
"""

import bpy

import prt_core.blender  # noqa: F401  (makes Blender's ray casters known)

from . import (
    exporting,
    field_operators,
    field_panel,
    following,
    history,
    keeping,
    light_sets,
    lightmaps,
    live,
    looking,
    moving,
    occlusion,
    operators,
    panel_bakes,
    panel_light,
    panel_look,
    panel_output,
    panels,
    plan,
    preview,
    properties,
    remedies,
    rendering,
    web_page,
    work,
)

_PARTS = (
    properties,
    operators,
    moving,
    field_operators,
    keeping,
    exporting,
    web_page,
    lightmaps,
    occlusion,
    remedies,
    looking,
    light_sets,
    panels,
    panel_light,
    panel_look,
    panel_output,
    panel_bakes,
    field_panel,
    rendering,
    following,
    live,
    history,
)
_COMMANDS = []


def register():
    for part in _PARTS:
        part.register()
    _COMMANDS.append(bpy.utils.register_cli_command("prt", _command))


def unregister():
    work.stop_all()
    while _COMMANDS:
        bpy.utils.unregister_cli_command(_COMMANDS.pop())
    for part in reversed(_PARTS):
        part.unregister()
    preview.forget()
    plan.forget()


def _command(arguments):
    """`blender -b scene.blend --command prt …`: the whole command line."""
    from prt_core.cli import main

    try:
        return main(arguments, in_blender=True)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
