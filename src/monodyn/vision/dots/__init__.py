"""Equal dots in the foreground of a clip in, points by name out."""
