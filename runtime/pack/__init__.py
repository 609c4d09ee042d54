"""Charts packed into the unit square with padding, and the vertices doubled along their seams."""
