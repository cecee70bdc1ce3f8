"""The method of 2012 as published; the default method does not depend on it."""
