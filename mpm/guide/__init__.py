"""What a newcomer asks: list, explain, new."""
