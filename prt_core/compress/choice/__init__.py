"""The methods by name, and the choice among them."""

from prt_core.compress.choice import standard  # noqa: F401  (makes the methods known)
from prt_core.compress.choice.choose import Limits, Trial, choose_steps
from prt_core.compress.choice.methods import (
    Method,
    Task,
    candidate_names,
    method_from_text,
    method_named,
    method_names,
    register_method,
)

__all__ = [
    "Limits",
    "Method",
    "Task",
    "Trial",
    "candidate_names",
    "choose_steps",
    "method_from_text",
    "method_named",
    "method_names",
    "register_method",
]
