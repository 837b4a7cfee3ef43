"""Hard cases of the layered simulation: whether a frame is right, refused by name, or silently wrong."""
