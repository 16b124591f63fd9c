-- Masses that grow by large ratios per link: v' keeps its digits, and the reference is not blamed for rounding of its own.
vehicle "vehicle.yaml"
mission { duration = 0.2, integrator = { method = "dopri5", relative = 1e-9 }, output = { rate = "100 Hz" } }
