"""How light travels: visibility as bits, the gather operator K, and the factored transport."""

from prt_core.transport.bounce import all_bounces, received_with_bounces
from prt_core.transport.details import detail_steps
from prt_core.transport.emission import emitted_light, surface_lights
from prt_core.transport.exit_radiance import ExitRadiance
from prt_core.transport.gather import gather_directions, gather_hits, gather_parts
from prt_core.transport.lamps import blocking_caster, lamp_light, lamp_steps
from prt_core.transport.occlusion import Occlusion, occlusion_steps
from prt_core.transport.operator import gather_operator, ray_ends
from prt_core.transport.partial import PartialTransport, SpreadGather
from prt_core.transport.reference import reference_rows
from prt_core.transport.reflections import Reflections, reflection_hits
from prt_core.transport.sharing import Sharing
from prt_core.transport.sides import side_steps
from prt_core.transport.transport import Transport
from prt_core.transport.view import View
from prt_core.transport.visibility import received_light, visibility_bits

__all__ = [
    "ExitRadiance",
    "Occlusion",
    "PartialTransport",
    "Reflections",
    "Sharing",
    "SpreadGather",
    "Transport",
    "View",
    "all_bounces",
    "detail_steps",
    "emitted_light",
    "gather_directions",
    "gather_hits",
    "gather_operator",
    "gather_parts",
    "blocking_caster",
    "lamp_light",
    "lamp_steps",
    "occlusion_steps",
    "ray_ends",
    "received_light",
    "received_with_bounces",
    "reference_rows",
    "reflection_hits",
    "side_steps",
    "surface_lights",
    "visibility_bits",
]
