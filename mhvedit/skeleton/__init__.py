"""Skeletons: BVH in, joint positions out."""
