-- The car axis of Schneider, from the Test Set for IVP Solvers: the wheel on the right follows 0.1 sin(10 t), that on the left stays, and the car, two
-- masses at the distance 1, stands on springs of k = 1e4 between; that on the left is held at right angles to the axle. At t = 3 the set has these places
-- and rates.
local sat = vehicle "vehicle.yaml"
mission { duration = 3, integrator = { method = "dop853", relative = 1e-12 } }
sat:loop "road":profile { sine = { amplitude = 0.1, frequency = 10 / (2 * math.pi) } }
local left, right = sat:body "left", sat:node "right.end"
-- Its fast motion has passed 13,000 rad: 1e-12 a step, some hundred times.
local function is(name, expected, value) check { name = name, value = value, equal = { expected, tolerance = 1e-9 } } end
is("left, x", 0.0493455784275402809, function() return (left:position()) end)
is("left, y", 0.496989460230171154, function() return (select(2, left:position())) end)
is("right, x", 1.04174252488542152, function() return (right:position()) end)
is("right, y", 0.373911027265361257, function() return (select(2, right:position())) end)
is("left, rate of x", -0.0770583684040972358, function() return (left:velocity()) end)
is("left, rate of y", 0.00744686658723778553, function() return (select(2, left:velocity())) end)
is("right, rate of x", 0.0175568157537232222, function() return (right:velocity()) end)
is("right, rate of y", 0.770341043779251976, function() return (select(2, right:velocity())) end)
