"""Hard cases: a catalogue with known truths, and what becomes of every method in each."""
