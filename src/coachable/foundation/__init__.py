"""What every room stands on: errors, files, typed data, the palette."""
