"""What must hold between two people in a key segment: interaction, fidelity, visibility."""
