"""The scenes that light fields are measured on, and what is said of their figures."""

import math

import bpy
import pytest

from tests.benchmarks import lightfield_page as page
from tests.benchmarks.lightfield_scenes import CASES, PEAK

LAMPS = {"translucent_gold_glossy": 4, "silver_and_glossy": 10, "gold_ring": 6, "soft_materials": 2}


@pytest.mark.parametrize("name", CASES)
def test_a_case_is_a_scene_with_what_it_names(name):
    case = CASES[name]
    case.build()
    scene = bpy.context.scene
    meshes = {item.name for item in scene.objects if item.type == "MESH"}
    lamps = [item.data for item in scene.objects if item.type == "LIGHT"]
    assert scene.camera is not None and set(case.objects or meshes) <= meshes
    assert len(lamps) == LAMPS.get(name, 3)
    for lamp in lamps:
        if lamp.type == "POINT":
            radius = lamp.shadow_soft_size
            radiance = lamp.energy / (4 * math.pi**2 * radius**2)
            assert radiance == pytest.approx(8 if name == "soft_materials" else PEAK)


@pytest.mark.parametrize("alpha", page.ALPHAS)
def test_roughness_is_the_square_root_of_alpha(alpha):
    CASES[f"sphere_{alpha}"].build()
    nodes = bpy.data.materials["shared"].node_tree.nodes
    (gloss,) = (node for node in nodes if node.type == "BSDF_GLOSSY")
    assert gloss.inputs["Roughness"].default_value ** 2 == pytest.approx(alpha)


def test_misses_are_said():
    rows = [
        ("CEOB, hard", [37.0, 40.0], 1.0), ("PCA", [20.0, 21.0], 1.0),
        ("K-SVD, 64 atoms", [38.0, 39.0], 1.0),
    ]  # fmt: skip
    text = "\n".join(page.coefficient_lines(0.05, rows))
    assert "CEOB at 16: 37.0 dB, floor 36.5: met" in text
    assert "CEOB at 32: 40.0 dB, floor 41: **missed**" in text
    assert "17.0 dB, floor 15: met" in text
    assert "above CEOB at 16 are K-SVD, 64 atoms" in text
