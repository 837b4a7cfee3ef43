"""From MRI volumes of one hand in several poses to an animated, layered finite-element hand."""

__version__ = "0.1.0"
