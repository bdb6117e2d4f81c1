"""Which gait it is: measures of recorded walks, by when the feet are on the ground."""
