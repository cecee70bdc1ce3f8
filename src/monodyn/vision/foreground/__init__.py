"""Frames in, soft foreground coverage out."""
