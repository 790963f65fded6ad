"""The API by itself, in the Blender that the command line is compared in."""

import numpy as np

import prt_core

prt_core.bake(None, "api.prt", resolution=8, tolerance=0.02)
np.savez("api.npz", **prt_core.relight("api.prt", "world"))
