"""Face Poser: interactive posing of 3D faces with learned priors."""
