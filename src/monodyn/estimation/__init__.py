"""Tracked motion in, identified mechanism out."""
