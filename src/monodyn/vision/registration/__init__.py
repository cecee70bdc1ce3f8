"""A clip of a camera that moves in, the same clip as a camera that stands still would have filmed it out."""
