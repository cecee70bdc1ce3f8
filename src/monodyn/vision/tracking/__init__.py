"""What following a mechanism from frame to frame rests on: its motion, what hides it."""
