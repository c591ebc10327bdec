"""Write a run as one HTML page that anyone can open."""
