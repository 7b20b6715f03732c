"""The tables of Jubien, Gautier and Janot 2014, compared with the derivation."""
