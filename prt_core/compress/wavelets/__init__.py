"""Few wavelets: of the light alone, or of light and points together."""

from prt_core.compress.wavelets.haar_lighting import HaarLighting, IncrementalLighting
from prt_core.compress.wavelets.wavelet4d import Wavelet4D

__all__ = ["HaarLighting", "IncrementalLighting", "Wavelet4D"]
