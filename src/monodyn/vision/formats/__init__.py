"""Tables of tracked points as other tools write them: one reader a tool."""
