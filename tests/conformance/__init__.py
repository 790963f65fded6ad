"""Small scenes of one feature of Blender each, held against what Cycles bakes of them."""
