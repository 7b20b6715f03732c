"""What a user types: the commands, the terminal they speak to, the demo."""
