"""What came out of a study: statistics, claims, table and figures, from its run folder alone."""
