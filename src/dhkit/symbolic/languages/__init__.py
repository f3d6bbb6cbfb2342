"""Languages of generated code: one intermediate form, and a printer of its statements for each language."""
