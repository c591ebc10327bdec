"""Shape from few drawings: elliptic sections between the front and the side drawing."""
