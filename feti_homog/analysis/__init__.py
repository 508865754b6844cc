"""What is asked of the torn cell: its stiffness, its response to debonding angles, or a path of strain."""
