"""The least-squares problem of a motion, solved by multiple shooting."""
