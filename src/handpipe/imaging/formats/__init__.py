"""Readers of image files: each gives the stored voxels and where they lie in RAS mm."""
