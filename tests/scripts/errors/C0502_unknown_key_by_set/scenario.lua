-- exit: 2
-- arguments: --set mission.integrator.methode=rk4
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
