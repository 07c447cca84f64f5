"""Building of the morphable model of heads: statistics, attributes, skins."""
