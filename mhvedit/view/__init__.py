"""Pictures and the report; the only package that imports pyvista and matplotlib."""
