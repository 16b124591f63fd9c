-- exit: 2
-- argument: --set
-- argument: mission.integrator.methode=rk4
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
