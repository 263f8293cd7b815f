"""The best chain of placements over all key segments, and the paths between them."""
