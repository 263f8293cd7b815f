"""Captures: mesh sequences, joint tracks, key segments and their alignment in time, facing and gaze."""
