"""Which entries of the visibility are traced, and how far the others are from the truth."""

from prt_core.sampling.sampled import Sampled, register_sampler, sampler_named

__all__ = ["Sampled", "register_sampler", "sampler_named"]
