"""What is different in one of several recordings: a signal, its torques, its clock."""
