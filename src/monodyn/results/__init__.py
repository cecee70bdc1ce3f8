"""What follows from a fit: prediction, filled gaps, tables, the overlay and the report."""
