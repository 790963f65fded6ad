"""Dictionaries that are learned: pairs of orthonormal bases, and atoms."""
