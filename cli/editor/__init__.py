"""The page that corrects a bundle: what it shows, its server, and how a change is fitted."""
