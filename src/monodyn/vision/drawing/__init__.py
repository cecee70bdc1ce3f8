"""The mechanism before a camera as it is drawn: outlines, silhouettes, and edges met by them."""
