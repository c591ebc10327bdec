"""Find cameras from the drawings alone, for characters that no mannequin resembles."""
