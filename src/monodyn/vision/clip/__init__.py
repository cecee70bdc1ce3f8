"""A file or folder of pictures in, upright frames with time stamps out."""
