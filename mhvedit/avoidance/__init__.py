"""Self-collision removed from a motion: constraint trajectories with a filter, or posture prediction with bisection."""
