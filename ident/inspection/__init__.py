"""What is in a log, what is wrong with it, what its motion can show, and a first study of it."""
