"""Contact of the surfaces of a posed face: lids with eyeballs and with each other, lips with teeth."""
