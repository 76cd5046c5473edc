"""From a CasADi graph to a formula as one writes it, and its lines on the page."""
