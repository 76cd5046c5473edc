"""A derivation as HTML or LaTeX, and the page that everything else is written on."""
