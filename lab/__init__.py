"""What measures toonset, and tries to break it; no part of the installed package."""
