"""How sheets of few drawings of one side do, by how many they are and how far they differ."""
