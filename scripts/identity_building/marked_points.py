"""Points of ear and nose that were marked by hand on our skin and on the mean of the scans.

The networks see no ears, and few points around the wings of the nose, where surfaces fold. Each row has a vertex of our
skin, on the left, and the place on the mean of the scans in centimetres; the right half mirrors it.
"""

#: The left ear.
EAR = (
    (12296, (7.71, 2.69, 1.33)),  # front of the helix
    (16839, (8.33, 3.3, 0.63)),  # helix, upper front
    (12253, (8.74, 3.52, -0.08)),  # top
    (16858, (9.03, 3.17, -0.98)),  # helix, upper back
    (3968, (9.08, 2.62, -1.38)),  # helix, back
    (3970, (9.11, 1.78, -1.5)),  # back
    (16885, (8.91, 0.84, -1.44)),  # helix, lower back
    (16971, (8.65, -0.06, -0.91)),  # helix, low
    (12398, (8.36, -0.82, -0.38)),  # above the lobe
    (12350, (8.08, -1.44, 0.15)),  # back of the lobe
    (12276, (7.54, -1.9, 0.82)),  # bottom of the lobe
    (12913, (6.96, -1.91, 1.63)),  # front of the lobe
    (4143, (6.6, 0.44, 0.93)),  # tragus
    (16892, (7.03, -0.24, 1.25)),  # notch below the tragus
    (17044, (7.6, 1.82, 0.07)),  # upper edge of the concha
    (17089, (8.45, 0.6, -0.52)),  # back edge of the concha
    (12750, (6.88, 0.58, 0.16)),  # middle of the concha
    (4245, (7.86, -0.32, 0.43)),  # antitragus
    (4138, (8.48, 3.09, -0.15)),  # groove under the top
)
#: The left half of the nose, and the peak of the upper lip.
NOSE = (
    (9487, (1.43, 0.58, 11.23)),  # groove of the wing, top
    (9492, (1.64, 0.4, 10.78)),  # groove of the wing, upper
    (11777, (1.83, -0.17, 10.5)),  # groove of the wing, side
    (16346, (1.72, -0.74, 10.58)),  # groove of the wing, low
    (2491, (1.44, -0.93, 10.81)),  # bottom of the wing
    (9607, (1.37, -0.69, 11.17)),  # nostril, back
    (9566, (1.15, -0.27, 12.06)),  # nostril, top
    (9579, (0.71, -0.38, 12.34)),  # nostril, front
    (15327, (1.38, -0.39, 11.67)),  # nostril, side
    (9637, (0.23, -2.37, 11.79)),  # peak of the upper lip
)
