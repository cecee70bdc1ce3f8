"""Masks and topology in, the scene out: camera, sizes, poses of key frames."""
