"""Files for other programs: USD, glTF, folders of meshes, movies."""
