-- Bodies that cannot move are merged; their places and reactions are still there.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s", output = { reactions = { "table", "box" } } }
local foot, seat, box = sat:hinge "table", sat:hinge "box", sat:body "box"
check { name = "weight of both", unit = "N", value = function() return (select(6, foot:reaction())) end, equal = { 130, tolerance = 1e-9 } }
check { name = "moment of the box", unit = "N m", value = function() return (select(2, foot:reaction())) end, equal = { -60, tolerance = 1e-9 } }
check { name = "weight of the box", unit = "N", value = function() return (select(6, seat:reaction())) end, equal = { 30, tolerance = 1e-9 } }
check { name = "place of the box", unit = "m", value = function() return (box:position()) end, equal = { 2 } }
check { name = "turn of the box", unit = "deg", value = function() return math.deg(quat.to_rotation_vector({ box:attitude() })[3]) end,
        equal = { 90, tolerance = 1e-9 } }
