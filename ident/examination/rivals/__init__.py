"""What may be there in place of a fault that a check names, and checks that are held against it."""
