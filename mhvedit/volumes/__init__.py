"""Voxels: solid meshes, motion history volumes, interest volumes, surface labels."""
