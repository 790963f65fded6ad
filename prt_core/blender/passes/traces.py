"""Renders that leave no trace: settings put back, no handlers, no lines, no image."""

import os
import sys
from contextlib import contextmanager

import bpy


@contextmanager
def switched(item, name, value):
    """An attribute of something of Blender's has another value for as long as it lasts."""
    before = getattr(item, name)
    if before == value:
        yield
        return
    setattr(item, name, value)
    try:
        yield
    finally:
        setattr(item, name, before)


@contextmanager
def same_images():
    """Without the image that Blender shows renders in, where there was none."""
    before = {image.session_uid for image in bpy.data.images}
    try:
        yield
    finally:
        for image in [image for image in bpy.data.images if image.session_uid not in before]:
            bpy.data.images.remove(image)


@contextmanager
def no_handlers():
    """Other add-ons are not called as if the user rendered."""
    lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)
             if name.startswith("render_")]  # fmt: skip
    kept = [list(handlers) for handlers in lists]
    for handlers in lists:
        handlers.clear()
    try:
        yield
    finally:
        for handlers, before in zip(lists, kept, strict=True):
            handlers[:] = before


@contextmanager
def no_output():
    """Without the lines that Blender prints of each render."""
    sys.stdout.flush()
    try:
        kept = os.dup(1)
    except OSError:  # a window without a terminal
        yield
        return
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
