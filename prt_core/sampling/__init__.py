"""Which entries of the visibility are traced, and how far the others are from the truth."""

from prt_core.sampling.agreement import AgreementSettings, refine_agreement, sample_agreement
from prt_core.sampling.huang import HuangSettings, sample_huang
from prt_core.sampling.open_sky import open_points
from prt_core.sampling.sampled import Sampled, register_sampler, sampler_named

__all__ = [
    "AgreementSettings",
    "HuangSettings",
    "Sampled",
    "open_points",
    "refine_agreement",
    "register_sampler",
    "sample_agreement",
    "sample_huang",
    "sampler_named",
]
