"""The run folder: its writer, its reader, and what both agree on."""
