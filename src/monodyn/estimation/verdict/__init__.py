"""The optimum in, intervals, status and advice out."""
