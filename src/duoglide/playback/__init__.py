"""What a recorded run gives back: its numbers, other formats, a comparison, the motion again."""
