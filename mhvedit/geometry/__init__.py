"""Arrays in, arrays out: planar poses, voxel lattices, shapes."""
