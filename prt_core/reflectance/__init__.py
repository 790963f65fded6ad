"""What surfaces do with light: the quantities that their materials have at each point."""

from prt_core.reflectance.materials import Materials, expect_materials
from prt_core.reflectance.quantities import QUANTITIES, Quantity

__all__ = ["Materials", "QUANTITIES", "Quantity", "expect_materials"]
