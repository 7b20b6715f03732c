"""HTML reports of a fit and of a diagnosis: one self-contained file each, readable offline."""
