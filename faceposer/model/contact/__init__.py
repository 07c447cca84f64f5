"""Keeps the surfaces of a posed face apart: lids on eyeballs, lid on lid, lips before teeth, teeth inside the skin."""
