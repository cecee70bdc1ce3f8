"""A clip of a planar mechanism in, a simulator of it out."""
