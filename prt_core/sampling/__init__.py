"""Which entries of the visibility are traced, and how far the others are from the truth."""

from prt_core.sampling.agreement import (
    AgreementSettings,
    refine_agreement,
    sample_agreement,
    trace_rest,
)
from prt_core.sampling.certificate import (
    CertificateSettings,
    Estimate,
    ObjectError,
    certificate_steps,
    probe_lights,
)
from prt_core.sampling.groups import Groups, certified_together
from prt_core.sampling.huang import HuangSettings, sample_huang
from prt_core.sampling.known import Known
from prt_core.sampling.refinement import Refinement, RefineSettings, refine_steps
from prt_core.sampling.sampled import (
    LevelDone,
    Sampled,
    register_sampler,
    sampler_named,
    sampler_names,
)
from prt_core.sampling.spread import Spread
from prt_core.sampling.tiles import tile_scene, tiles_of

__all__ = [
    "AgreementSettings",
    "CertificateSettings",
    "Estimate",
    "Groups",
    "HuangSettings",
    "Known",
    "LevelDone",
    "ObjectError",
    "RefineSettings",
    "Refinement",
    "Sampled",
    "Spread",
    "certificate_steps",
    "certified_together",
    "probe_lights",
    "refine_agreement",
    "refine_steps",
    "register_sampler",
    "sample_agreement",
    "sample_huang",
    "sampler_named",
    "sampler_names",
    "tile_scene",
    "tiles_of",
    "trace_rest",
]
