"""Every planar placement of one person beside another that satisfies the constraints of a key segment."""
