"""The mechanism drawn before a camera: outlines, silhouettes, and the edges of a mask near them."""
