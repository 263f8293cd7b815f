"""A driven body among fixed and simulated ones (Schmidl and Lin): no overlap, and impulses where things meet."""
