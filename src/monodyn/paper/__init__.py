"""The method of 2012 as published: nothing of the default method needs it."""
