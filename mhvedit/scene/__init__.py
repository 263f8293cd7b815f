"""The edited scene: everybody's frames and placements, and checks on the meshes themselves."""
