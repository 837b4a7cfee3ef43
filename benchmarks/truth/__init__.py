"""Figures of the coupled truth, measured on the toy finger."""
