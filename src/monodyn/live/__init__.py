"""A stream in, the mechanism at every moment out: located, followed, identified while the frames come."""
