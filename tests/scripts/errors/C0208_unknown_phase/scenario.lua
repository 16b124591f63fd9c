-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
phase { name = "point", duration = "1 s", next = "slw" }
phase { name = "slew" }
