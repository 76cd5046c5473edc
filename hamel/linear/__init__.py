"""What `hamel linearize` needs beside the derivation: ranges from the command line, rows for the
record, and the page."""
