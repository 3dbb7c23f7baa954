"""Hard cases: a catalogue of difficult simulations with reference solutions, on which every method is tested."""
