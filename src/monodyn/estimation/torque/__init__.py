"""What acts at the joints: friction, a periodic torque, or any torque."""
