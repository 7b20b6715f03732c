"""What is wrong with the data, said before anything is said about the robot."""
