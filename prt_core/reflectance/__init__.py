"""What surfaces do with light: the quantities that their materials have at each point."""

from prt_core.reflectance.materials import (
    QUANTITIES,
    Materials,
    Quantity,
    expect_materials,
)

__all__ = ["Materials", "QUANTITIES", "Quantity", "expect_materials"]
