"""What is told: findings, what is left of which torque, its noise, and what would have been seen."""
