"""The experiment of the 2012 paper, repeated on a clip whose truth is known."""
