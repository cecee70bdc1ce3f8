"""Tracked points of other tools and topology in, the scene and poses out."""
