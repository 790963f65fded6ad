"""The version, by itself: what writes it down does not import the whole package."""

__version__ = "0.1.0"
