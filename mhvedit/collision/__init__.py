"""Detection of self-collision: limbs, box trees, triangles, depth; sphere groups and equipment."""
