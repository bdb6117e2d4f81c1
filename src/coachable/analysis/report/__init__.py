"""The report: one HTML page that shows what was learned, from run folders alone."""
