"""A run as one HTML page that anyone can open: its data packed, its pictures, the page itself."""
