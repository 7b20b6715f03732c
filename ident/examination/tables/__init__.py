"""What the columns of one recording show each for itself: clocks, samples, signals."""
