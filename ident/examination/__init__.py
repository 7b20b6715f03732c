"""What is wrong with the data, said before anything is said about the robot.

check -> tables/ -> fits/ -> torques/ -> positions/ -> rivals/ -> one_recording/, robot/ -> examine
-> undone"""
