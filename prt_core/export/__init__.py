"""Bakes for other programs: what leaves Blender."""
